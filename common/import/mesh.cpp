#include "common/import/mesh.h"

#include <assimp/DefaultIOSystem.h>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#include <charconv>
#include <stdexcept>

#include "common/scene/convex_hull.h"

namespace soda {
namespace {

// Notes which files are opened.
class NotingFiles : public Assimp::DefaultIOSystem {
 public:
  explicit NotingFiles(std::vector<std::filesystem::path>* opened) : opened_(opened) {}
  Assimp::IOStream* Open(const char* file, const char* mode) override {
    Assimp::IOStream* stream = DefaultIOSystem::Open(file, mode);
    if (stream && opened_) opened_->push_back(file);
    return stream;
  }

 private:
  std::vector<std::filesystem::path>* opened_;
};

double as_written(float value) {
  char digits[32];
  const auto end = std::to_chars(digits, digits + sizeof digits, value).ptr;
  double result = 0;
  std::from_chars(digits, end, result);
  return result;
}

}  // namespace

Geometry load_mesh(const MeshRequest& request, std::vector<std::filesystem::path>* files_read) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(request.file, error))
    throw std::runtime_error("no such mesh file: " + request.file.string());
  for (int axis = 0; axis < 3; ++axis)
    if (!(std::abs(request.scale[axis]) >= 1e-9 && std::abs(request.scale[axis]) <= 1e9))
      throw std::runtime_error("the scale of a mesh must not be zero: " + request.file.string());

  Assimp::Importer importer;
  importer.SetIOHandler(new NotingFiles(files_read));  // owned by the importer
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  importer.SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
  // Only positions matter; without normals and the like, assimp joins what is one corner.
  importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS, aiComponent_NORMALS | aiComponent_TANGENTS_AND_BITANGENTS |
                                                          aiComponent_COLORS | aiComponent_TEXCOORDS |
                                                          aiComponent_BONEWEIGHTS | aiComponent_ANIMATIONS |
                                                          aiComponent_TEXTURES | aiComponent_LIGHTS |
                                                          aiComponent_CAMERAS | aiComponent_MATERIALS);
  const aiScene* scene = importer.ReadFile(
      request.file.string(), aiProcess_RemoveComponent | aiProcess_Triangulate | aiProcess_JoinIdenticalVertices |
                                 aiProcess_SortByPType | aiProcess_PreTransformVertices);
  if (!scene) throw std::runtime_error("cannot read the mesh: " + std::string(importer.GetErrorString()));

  TriangleMesh mesh;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
    const aiMesh& part = *scene->mMeshes[m];
    if (!request.submesh.empty() && request.submesh != part.mName.C_Str()) continue;
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (unsigned v = 0; v < part.mNumVertices; ++v)
      mesh.vertices.emplace_back(as_written(part.mVertices[v].x), as_written(part.mVertices[v].y),
                                 as_written(part.mVertices[v].z));
    for (unsigned f = 0; f < part.mNumFaces; ++f) {
      const aiFace& face = part.mFaces[f];
      if (face.mNumIndices != 3) continue;
      std::array<std::uint32_t, 3> t{first + face.mIndices[0], first + face.mIndices[1], first + face.mIndices[2]};
      const Vec3& a = mesh.vertices[t[0]];
      if ((mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a).squaredNorm() > 0) mesh.triangles.push_back(t);
    }
  }
  if (mesh.triangles.empty())
    throw std::runtime_error(
        (request.submesh.empty() ? "the mesh has no triangles: " : "there is no mesh \"" + request.submesh + "\" in ") +
        request.file.string());
  if (request.centre_submesh) {
    Vec3 low = mesh.vertices[0], high = low;
    for (const Vec3& v : mesh.vertices) low = low.cwiseMin(v), high = high.cwiseMax(v);
    for (Vec3& v : mesh.vertices) v -= 0.5 * (low + high);
  }
  for (Vec3& v : mesh.vertices) v = v.cwiseProduct(request.scale);
  if (request.scale.prod() < 0)  // a mirrored mesh is inside out
    for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  if (!request.convex) return mesh;
  for (const Vec3& v : mesh.vertices)
    if (!v.allFinite()) throw std::runtime_error("a vertex is not finite in " + request.file.string());
  ConvexHull hull{hull_corners(std::move(mesh.vertices))};
  if (hull.points.empty())
    throw std::runtime_error("the mesh is flat, it has no convex hull: " + request.file.string());
  return hull;
}

}  // namespace soda
