// A scene between Protobuf (idl/scene.proto) and Scene.
#pragma once

#include <functional>
#include <string_view>

#include "common/scene/scene.h"
#include "common/scene/validate.h"
#include "scene.pb.h"

namespace soda {

// Reads the mesh file of a `mesh_file` shape. Throws std::runtime_error with the reason when it cannot.
using MeshLoader = std::function<Geometry(const pb::MeshFile& file, bool convex)>;

// All that a scene holds, with geometry in the shared table and every derived value written out.
pb::Scene to_proto(const Scene& scene);

// The scene with its materials applied, compounds flattened, missing ids and inertials filled in, hulls reduced to
// their corners, bodies sorted by id, joints by their bodies, and everything validated. Throws SceneError, whose
// body_index counts the bodies in the message's order. from_proto(to_proto(s)) has the bits of s. Without a mesh
// loader, mesh files are refused.
Scene from_proto(const pb::Scene& message, std::string_view source, const MeshLoader& mesh_loader = {});

// Throws FieldError, which names territory[I] and what is wrong with it.
std::vector<Territory> read_territories(const google::protobuf::RepeatedPtrField<pb::Territory>& messages);

}  // namespace soda
