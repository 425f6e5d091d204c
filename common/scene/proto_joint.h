// Joints between Protobuf and Scene. Part of proto_scene.h.
#pragma once

#include "common/scene/proto_geometry.h"
#include "common/scene/scene.h"
#include "scene.pb.h"

namespace soda {

// Of a scene whose bodies are there, ascending by id: with what the message leaves out filled in, and its ends as the
// simulation has them. What is wrong is told in the message's own numbers: throws FieldError.
Joint read_joint(const pb::Joint& message, const Scene& scene);
void write_joint(const Joint& joint, pb::Joint* out);

}  // namespace soda
