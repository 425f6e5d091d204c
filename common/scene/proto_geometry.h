// Geometry between Protobuf and Scene. Part of proto_scene.h.
#pragma once

#include <stdexcept>
#include <string>

#include "common/scene/scene.h"
#include "common/scene/validate.h"
#include "scene.pb.h"

namespace soda {

// Thrown by the functions below; the caller knows the body and puts its field's name in front.
struct FieldError : std::runtime_error {
  FieldError(std::string field_, const std::string& reason_)
      : std::runtime_error(field_ + ": " + reason_), field(std::move(field_)), reason(reason_) {}
  std::string field, reason;
};

// Refuses fields that this version does not know: they may mean anything.
void refuse_unknown(const google::protobuf::Message& message, const std::string& field);

Vec3 read_vec3(const pb::Vec3& v, const std::string& field);
void write_vec3(const Vec3& v, pb::Vec3* out);

// Normalises the quaternion where it is not of unit length already; refuses one that has no direction.
Pose read_pose(const pb::Pose& pose, const std::string& field);
void write_pose(const Pose& pose, pb::Pose* out);

// The geometry of a Shape or Geometry message, of a kind that stands for itself (not compound, mesh_file or shared).
// Hulls come out reduced to their corners.
Geometry read_geometry(const pb::Shape& shape, const std::string& field);
Geometry read_geometry(const pb::Geometry& geometry, const std::string& field);
void write_geometry(const Geometry& geometry, pb::Geometry* out);

}  // namespace soda
