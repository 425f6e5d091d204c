// One model that libsdformat has read, as bodies and joints.
#pragma once

#include <filesystem>
#include <map>
#include <sdf/Collision.hh>
#include <sdf/Geometry.hh>
#include <sdf/Joint.hh>
#include <sdf/Link.hh>
#include <sdf/Mesh.hh>
#include <sdf/Model.hh>
#include <string>
#include <vector>

#include "common/import/mesh.h"
#include "common/import/warnings.h"
#include "common/scene/mass_properties.h"
#include "common/scene/scene_builder.h"

namespace soda {

struct ConvertedModel {
  // Poses are in the model's frame; names are scoped within the model ("nested::link"); no ids yet.
  std::vector<Body> bodies;
  // Ends are places in `bodies` from 1, or 0 for the world, whose frame is in the model's. Names are scoped likewise.
  std::vector<Joint> joints;
  double radius = 0;  // m, of a sphere about the model's origin that holds its dynamic bodies
  Pose pose;          // of the model in the document that it was read from
  Pose placement;     // model frame in its placement frame: what a given pose is multiplied with
};

class SdfModelConverter {
 public:
  // Geometry goes into the builder's table. `source` and `base` are the SDF file and its folder.
  SdfModelConverter(SceneBuilder& builder, Warnings& warnings, std::string source, std::filesystem::path base)
      : builder_(builder),
        warnings_(warnings),
        source_(std::move(source)),
        base_(std::move(base)),
        masses_(builder.scene) {}

  // `uses`: how often warnings count. Throws SceneError.
  ConvertedModel convert(const sdf::Model& model, std::size_t uses);

  // All files that were read: meshes, and those of <include>.
  const std::vector<std::filesystem::path>& files() const { return files_; }

 private:
  void note_file(const std::filesystem::path& file);
  void add_model(const sdf::Model& model, const std::string& scope, const Pose& pose, bool is_static);
  void add_link(const sdf::Link& link, const std::string& name, const Pose& model_pose, bool is_static);
  std::uint32_t read_geometry(const sdf::Geometry& geometry, const std::string& place, const std::string& field,
                              bool is_static);
  std::uint32_t read_mesh(const sdf::Mesh& mesh, const std::string& place, const std::string& field, bool is_static);
  void read_surface(const sdf::Collision& collision, const std::string& name, bool first, Body& body);
  void read_inertial(const sdf::Link& link, const std::string& name, Body& body);
  // In sdf_joint.cpp. After all links of the model and those within it.
  void add_joints(const sdf::Model& model, const std::string& scope);
  void add_joint(const sdf::Joint& joint, const std::string& scope);
  BodyId find_link(const std::string& name, const std::string& place, const char* end) const;
  void read_hinge_limits(const sdf::JointAxis& axis, const std::string& place, Joint& joint);
  [[noreturn]] void fail(const std::string& place, const std::string& field, const std::string& reason) const;

  SceneBuilder& builder_;
  Warnings& warnings_;
  std::string source_;
  std::filesystem::path base_;
  MassTable masses_;
  std::vector<std::filesystem::path> files_;
  std::map<std::string, std::uint32_t> meshes_;  // geometry of meshes that were read, by all that they depend on
  std::string top_;                              // name of the model being converted
  std::size_t uses_ = 1;
  std::vector<Body> bodies_;
  std::vector<Joint> joints_;
};

}  // namespace soda
