#include "common/scene/scene_file.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>
#include <google/protobuf/text_format.h>
#include <xxhash.h>

#include <cerrno>
#include <cstring>
#include <fstream>

#include "common/atomic_file.h"
#include "common/scene/proto_geometry.h"
#include "common/scene/proto_text.h"

namespace soda {
namespace {

namespace gp = google::protobuf;

// ---- the binary header: all little-endian -----------------------------------------------------------------------
struct Header {
  char magic[8];           // kMagic
  std::uint32_t version;   // kVersion
  std::uint32_t reserved;  // 0
  std::uint64_t length;    // bytes that follow
  std::uint64_t checksum;  // XXH64 of them
};
static_assert(sizeof(Header) == 32, "written as it is");
constexpr char kMagic[8] = {'S', 'O', 'D', 'A', 's', 'c', 'n', '\n'};
constexpr std::uint32_t kVersion = 1;

constexpr const char* kTextHeader =
    "# A SODA scene; docs/scenes.md explains the format.\n"
    "# proto-file: idl/scene.proto\n"
    "# proto-message: soda.pb.Scene\n\n";

[[noreturn]] void refuse(std::string_view source, const std::string& reason, int line = 0) {
  throw SceneError(std::string(source), "", "", reason, line);
}

void parse_text(std::string_view text, std::string_view source, gp::Message& message,
                gp::TextFormat::ParseInfoTree* lines) {
  if (const auto problem = read_text(text, message, lines))
    refuse(source, problem->reason + " (column " + std::to_string(problem->column) + ")", problem->line);
}

// Follows a path such as "body[3].shape[0].box.size.y" as far as the file has it, and returns the line of the last part
// found: a field that is missing is reported at what should have it.
int line_of(const gp::TextFormat::ParseInfoTree& root, const std::string& path) {
  const gp::TextFormat::ParseInfoTree* tree = &root;
  const gp::Descriptor* type = pb::Scene::descriptor();
  int line = 0;
  for (std::size_t start = 0; tree && type && start < path.size();) {
    std::size_t end = path.find('.', start);
    if (end == std::string::npos) end = path.size();
    std::string name = path.substr(start, end - start);
    start = end + 1;
    int index = -1;
    if (const std::size_t bracket = name.find('['); bracket != std::string::npos) {
      index = std::atoi(name.c_str() + bracket + 1);
      name.resize(bracket);
    }
    const gp::FieldDescriptor* field = type->FindFieldByName(name);
    if (!field) break;
    if (field->is_repeated() && index < 0) index = 0;
    if (!field->is_repeated()) index = -1;
    const gp::TextFormat::ParseLocation location = tree->GetLocation(field, index);
    if (location.line < 0) break;
    line = location.line + 1;
    if (field->cpp_type() != gp::FieldDescriptor::CPPTYPE_MESSAGE) break;
    tree = tree->GetTreeForNested(field, index);
    type = field->message_type();
  }
  return line;
}

void check_size(std::string_view bytes, std::string_view source) {
  if (bytes.empty()) refuse(source, "is empty");
  if (bytes.size() >= std::size_t{1} << 31) refuse(source, "is larger than 2 GiB");
}

}  // namespace

std::string encode_scene(const Scene& scene) {
  const pb::Scene message = to_proto(scene);
  std::string bytes(sizeof(Header), '\0');
  {
    gp::io::StringOutputStream stream(&bytes);
    gp::io::CodedOutputStream coded(&stream);
    coded.SetSerializationDeterministic(true);
    if (!message.SerializeToCodedStream(&coded)) refuse(scene.name, "is too large to be stored");
  }
  Header header{};
  std::memcpy(header.magic, kMagic, sizeof kMagic);
  header.version = kVersion;
  header.length = bytes.size() - sizeof header;
  header.checksum = XXH64(bytes.data() + sizeof header, header.length, 0);
  std::memcpy(bytes.data(), &header, sizeof header);
  return bytes;
}

Scene decode_scene(std::string_view bytes, std::string_view source) {
  check_size(bytes, source);
  Header header;
  const std::size_t shown = std::min(bytes.size(), sizeof kMagic);
  if (std::memcmp(bytes.data(), kMagic, shown) != 0) refuse(source, "is not a binary SODA scene");
  if (bytes.size() < sizeof header)
    refuse(source, "is cut short: " + std::to_string(bytes.size()) + " bytes, less than its header");
  std::memcpy(&header, bytes.data(), sizeof header);
  if (header.version != kVersion || header.reserved != 0)
    refuse(source, "has format version " + std::to_string(header.version) + "; this SODA reads version " +
                       std::to_string(kVersion));
  const std::string_view body = bytes.substr(sizeof header);
  if (body.size() < header.length)
    refuse(source, "is cut short: " + std::to_string(body.size()) + " of " + std::to_string(header.length) + " bytes");
  if (body.size() > header.length)
    refuse(source, "has " + std::to_string(body.size() - header.length) + " bytes too many");
  if (XXH64(body.data(), body.size(), 0) != header.checksum) refuse(source, "is damaged: its checksum is wrong");
  pb::Scene message;
  if (!message.ParseFromArray(body.data(), static_cast<int>(body.size()))) refuse(source, "is not a scene in Protobuf");
  return from_proto(message, source);
}

std::string scene_to_text(const Scene& scene) {
  gp::TextFormat::Printer printer;
  printer.SetUseShortRepeatedPrimitives(true);
  printer.SetUseUtf8StringEscaping(true);
  pb::Scene message = to_proto(scene), first;
  // Ahead of what it counts, so that no cut takes both away.
  if (message.has_joint_count()) first.set_joint_count(message.joint_count());
  message.clear_joint_count();
  if (message.has_model()) *first.mutable_model() = message.model();
  message.clear_model();
  first.mutable_territory()->Swap(message.mutable_territory());
  std::string count, text;
  if (!printer.PrintToString(first, &count) || !printer.PrintToString(message, &text))
    refuse(scene.name, "cannot be written as text");
  return kTextHeader + count + text;
}

Scene scene_from_text(std::string_view text, std::string_view source, const MeshLoader& mesh_loader) {
  check_size(text, source);
  pb::Scene message;
  parse_text(text, source, message, nullptr);
  try {
    return from_proto(message, source, mesh_loader);
  } catch (const SceneError& e) {
    // Only now worth the trouble: where in the file is it?
    gp::TextFormat::ParseInfoTree lines;
    pb::Scene again;
    parse_text(text, source, again, &lines);
    std::string path = e.field;
    if (e.body_index != SceneError::kNoBody) path = "body[" + std::to_string(e.body_index) + "]." + path;
    throw SceneError(e.source, e.body, e.field, e.reason, line_of(lines, path), e.body_index);
  }
}

Scene load_scene(const std::filesystem::path& path, const MeshLoader& mesh_loader) {
  const std::string extension = path.extension().string();
  if (extension == ".txtpb") return scene_from_text(read_file(path), path.string(), mesh_loader);
  if (extension == ".scene") return decode_scene(read_file(path), path.string());
  refuse(path.string(), "has not the extension of a scene: .txtpb (text) or .scene (binary)");
}

std::vector<Territory> load_territories(const std::filesystem::path& path) {
  const std::string text = read_file(path);
  check_size(text, path.string());
  pb::Territories message;
  parse_text(text, path.string(), message, nullptr);
  try {
    if (message.territory().empty()) throw FieldError("territory", "there is none");
    return read_territories(message.territory());
  } catch (const FieldError& e) {
    throw SceneError(path.string(), "", e.field, e.reason);
  }
}

void save_scene(const Scene& scene, const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  if (extension == ".txtpb")
    write_file(path, scene_to_text(scene));
  else if (extension == ".scene")
    write_file(path, encode_scene(scene));
  else
    refuse(path.string(), "has not the extension of a scene: .txtpb (text) or .scene (binary)");
}

std::string read_file(const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) refuse(path.string(), "is a directory");
  std::ifstream file(path, std::ios::binary);
  if (!file) refuse(path.string(), std::string("cannot be read: ") + std::strerror(errno));
  std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (file.bad()) refuse(path.string(), "cannot be read to its end");
  return bytes;
}

void write_file(const std::filesystem::path& path, std::string_view bytes) {
  try {
    AtomicFile file(path);
    file.write(bytes);
    file.commit();
  } catch (const FileError& e) {
    refuse(e.path.string(), e.reason);
  }
}

}  // namespace soda
