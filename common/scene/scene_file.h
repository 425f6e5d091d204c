// Scenes in files and in bytes.
//   .txtpb  Protobuf text format of idl/scene.proto, for people
//   .scene  binary: a header (magic, version, length, checksum), then Protobuf; what processes send each other
// Both keep every bit of every number.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "common/scene/proto_scene.h"
#include "common/scene/scene.h"

namespace soda {

// Reads, completes (see from_proto) and validates. Throws SceneError, with the line where a text file is wrong.
Scene load_scene(const std::filesystem::path& path, const MeshLoader& mesh_loader = {});

// Writes in the format of the extension, to a temporary file that then takes the name: a reader, or a crash, sees the
// old file or the new one. Throws SceneError.
void save_scene(const Scene& scene, const std::filesystem::path& path);

// The bytes of a .scene file. The same scene has the same bytes, so that a hash of them names it.
std::string encode_scene(const Scene& scene);
// `source_name` is the name that errors show.
Scene decode_scene(std::string_view bytes, std::string_view source_name);

// The text of a .txtpb file.
std::string scene_to_text(const Scene& scene);
Scene scene_from_text(std::string_view text, std::string_view source_name, const MeshLoader& mesh_loader = {});

// Territories by hand, from a text file of a pb.Territories (idl/scene.proto). They are checked with the scene that
// they are given to. Throws SceneError.
std::vector<Territory> load_territories(const std::filesystem::path& path);

// Whole files, for scenes and what they refer to. Throw SceneError. write_file writes as save_scene does (AtomicFile).
std::string read_file(const std::filesystem::path& path);
void write_file(const std::filesystem::path& path, std::string_view bytes);

}  // namespace soda
