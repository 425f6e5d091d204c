#include "common/recording/recording.h"

#include <xxhash.h>
#include <zstd.h>

#include <cstring>
#include <utility>

#include "common/scene/scene_file.h"
#include "common/scene/validate.h"
#include "common/scene_hash.h"

namespace soda {
namespace {

constexpr char kMagic[8] = {'S', 'O', 'D', 'A', 'r', 'e', 'c', '\n'};
constexpr std::uint32_t kVersion = 1;
constexpr std::size_t kMaxBlock = std::size_t{1} << 28;  // bytes, decompressed
constexpr std::size_t kPiece = std::size_t{1} << 22;     // of a scene, bytes
constexpr std::size_t kManyItems = 4096;
constexpr std::chrono::milliseconds kFlushEvery{800};
constexpr int kCompression = 3;

struct Header {
  char magic[8];
  std::uint32_t version;
  std::uint32_t reserved;
  std::uint64_t scene_hash;
};
static_assert(sizeof(Header) == 24, "written as it is");

struct BlockHeader {
  std::uint32_t length;
  std::uint32_t decompressed;
  std::uint64_t checksum;
};
static_assert(sizeof(BlockHeader) == 16, "written as it is");

// Reads blocks until the end, or until one that is not whole, or damaged, which it tells in the recording.
class Blocks {
 public:
  Blocks(std::ifstream& file, Recording& recording) : file_(file), recording_(recording) {}

  std::optional<pb::RecordedBlock> next() {
    BlockHeader header{};
    file_.read(reinterpret_cast<char*>(&header), sizeof header);
    if (file_.gcount() == 0) return std::nullopt;
    if (file_.gcount() != sizeof header) return stop("it ends in the middle of a block");
    if (header.decompressed > kMaxBlock || header.length > kMaxBlock) return damaged("a block of impossible length");
    bytes_.resize(header.length);
    file_.read(bytes_.data(), header.length);
    if (file_.gcount() != static_cast<std::streamsize>(header.length)) return stop("it ends in the middle of a block");
    if (XXH3_64bits(bytes_.data(), bytes_.size()) != header.checksum) return damaged("a block is damaged");
    std::string raw(header.decompressed, '\0');
    const std::size_t n = ZSTD_decompress(raw.data(), raw.size(), bytes_.data(), bytes_.size());
    pb::RecordedBlock block;
    if (ZSTD_isError(n) || n != raw.size() || !block.ParseFromString(raw)) return damaged("a block is damaged");
    return block;
  }

 private:
  std::nullopt_t damaged(const char* why) {
    recording_.damaged = true;
    return stop(why);
  }
  std::nullopt_t stop(const char* why) {
    recording_.cut = why;
    return std::nullopt;
  }
  std::ifstream& file_;
  Recording& recording_;
  std::string bytes_;
};

}  // namespace

RecordingWriter::RecordingWriter(std::filesystem::path path) : path_(std::move(path)), file_(path_, std::ios::binary) {
  if (!file_) throw RecordingError(path_.string() + ": cannot be written");
}

void RecordingWriter::begin(std::uint64_t scene_hash, const std::string& encoded_scene,
                            const pb::RecordedSettings& settings) {
  Header header{};
  std::memcpy(header.magic, kMagic, sizeof kMagic);
  header.version = kVersion;
  header.scene_hash = scene_hash;
  file_.write(reinterpret_cast<const char*>(&header), sizeof header);
  *next().mutable_settings() = settings;
  for (std::size_t at = 0; at < encoded_scene.size(); at += kPiece) {
    pb::RecordedScene* piece = next().mutable_scene();
    piece->set_piece(encoded_scene.substr(at, kPiece));
    piece->set_last(at + kPiece >= encoded_scene.size());
    flush();
  }
}

void RecordingWriter::add_action(ActionNumber number, std::string_view encoded) {
  pb::RecordedAction* action = next().mutable_action();
  action->set_number(number);
  if (!action->mutable_action()->ParseFromArray(encoded.data(), static_cast<int>(encoded.size())))
    throw RecordingError(path_.string() + ": action " + std::to_string(number) + " cannot be recorded");
  ++items_;
}

void RecordingWriter::add_digest(Step step, const StepDigest& digest) {
  const int n = block_.item_size();
  pb::RecordedDigests* digests = n > 0 && block_.item(n - 1).has_digests()
                                     ? block_.mutable_item(n - 1)->mutable_digests()
                                     : next().mutable_digests();
  if (digests->hashes_size() == 0) digests->set_first(step);
  digests->add_bodies(digest.bodies);
  digests->add_hashes(digest.hash);
  ++items_;
}

void RecordingWriter::add_poses(pb::RecordedPoses poses) {
  items_ += 1 + static_cast<std::size_t>(poses.ids_size()) / 16;
  *next().mutable_poses() = std::move(poses);
}

void RecordingWriter::flush_if_due() {
  if (items_ >= kManyItems || std::chrono::steady_clock::now() - flushed_ >= kFlushEvery) flush();
}

void RecordingWriter::flush() {
  flushed_ = std::chrono::steady_clock::now();
  if (block_.item_size() == 0) return;
  const std::string raw = block_.SerializeAsString();
  block_.clear_item();
  items_ = 0;
  std::string bytes(ZSTD_compressBound(raw.size()), '\0');
  const std::size_t n = ZSTD_compress(bytes.data(), bytes.size(), raw.data(), raw.size(), kCompression);
  if (ZSTD_isError(n)) throw RecordingError(path_.string() + ": cannot be compressed");
  const BlockHeader header{static_cast<std::uint32_t>(n), static_cast<std::uint32_t>(raw.size()),
                           XXH3_64bits(bytes.data(), n)};
  file_.write(reinterpret_cast<const char*>(&header), sizeof header);
  file_.write(bytes.data(), static_cast<std::streamsize>(n));
  file_.flush();
  if (!file_) throw RecordingError(path_.string() + ": cannot be written");
}

void RecordingWriter::close(bool complete) {
  if (complete) next().set_end(true);
  flush();
  file_.close();
  if (!file_) throw RecordingError(path_.string() + ": cannot be written");
}

void check_poses(const pb::RecordedPoses& poses, const std::string& file) {
  constexpr double kUnit = 1e-3;  // that the squared length may be off; rounding to float makes 1e-7
  const std::string at = file + ": poses at step " + std::to_string(poses.step());
  if (poses.values_size() != 7 * poses.ids_size()) throw RecordingError(at + ": not seven numbers for each body");
  for (int i = 0; i < poses.ids_size(); ++i) {
    const float* const values = poses.values().data() + std::ptrdiff_t{7} * i;
    const std::string who = ": body " + std::to_string(poses.ids(i));
    if (!std::all_of(values, values + 7, [](float v) { return std::isfinite(v); }))
      throw RecordingError(at + who + ": not finite");
    double squared = 0;
    for (int k = 3; k < 7; ++k) squared += static_cast<double>(values[k]) * values[k];
    if (!(std::abs(squared - 1) < kUnit)) throw RecordingError(at + who + ": its orientation is not a unit quaternion");
  }
}

Recording load_recording(const std::filesystem::path& path, bool with_poses) {
  const std::string name = path.string();
  std::ifstream file(path, std::ios::binary);
  if (!file) throw RecordingError(name + ": cannot be read");
  Header header{};
  file.read(reinterpret_cast<char*>(&header), sizeof header);
  if (file.gcount() != sizeof header || std::memcmp(header.magic, kMagic, sizeof kMagic) != 0)
    throw RecordingError(name + ": is not a recording of SODA");
  if (header.version != kVersion)
    throw RecordingError(name + ": is a recording of version " + std::to_string(header.version) + ", this soda reads " +
                         std::to_string(kVersion));
  Recording recording;
  recording.scene_hash = header.scene_hash;
  Blocks blocks(file, recording);
  bool has_scene = false;
  std::vector<pb::RecordedAction> actions;
  while (const auto block = blocks.next()) {
    for (const pb::RecordedItem& item : block->item()) {
      if (item.has_settings()) recording.settings = item.settings();
      if (item.has_scene()) {
        recording.encoded_scene += item.scene().piece();
        has_scene = has_scene || item.scene().last();
      }
      if (item.has_action()) actions.push_back(item.action());
      if (item.has_digests()) {
        if (item.digests().first() != static_cast<Step>(recording.digests.size()) ||
            item.digests().bodies_size() != item.digests().hashes_size())
          throw RecordingError(name + ": digests are not in order");
        for (int i = 0; i < item.digests().hashes_size(); ++i)
          recording.digests.push_back({item.digests().bodies(i), item.digests().hashes(i)});
      }
      if (item.has_poses() && with_poses) recording.poses.push_back(item.poses());
      recording.complete = recording.complete || item.end();
    }
  }
  if (!has_scene || recording.digests.empty())
    throw RecordingError(name + ": is cut off before its first step" +
                         (recording.cut.empty() ? "" : " (" + recording.cut + ")"));
  for (std::size_t i = 0; i < recording.poses.size(); ++i) {
    const Step step = recording.poses[i].step();
    if (step < 0 || (i > 0 && step <= recording.poses[i - 1].step()))
      throw RecordingError(name + ": poses are not in order");
    check_poses(recording.poses[i], name);
  }
  std::erase_if(recording.poses, [&](const pb::RecordedPoses& poses) {
    return poses.step() >= static_cast<Step>(recording.digests.size());
  });
  if (scene_hash(recording.encoded_scene) != header.scene_hash)
    throw RecordingError(name + ": its scene is not the one that its header names");
  if (!recording.complete && recording.cut.empty()) recording.cut = "the run did not come to its end";
  try {
    recording.scene = decode_scene(recording.encoded_scene, name + " (its scene)");
    for (const pb::RecordedAction& recorded : actions) {
      WantedAction wanted = from_proto(recorded.action(), recording.scene);
      if (recorded.number() != recording.actions.size() + 1 || !wanted.step)
        throw RecordingError(name + ": its actions are not in order");
      recording.actions.push_back({recorded.number(), *wanted.step, std::move(wanted.action)});
    }
  } catch (const SceneError& e) {
    throw RecordingError(e.what());
  } catch (const ActionError& e) {
    throw RecordingError(name + ": action " + std::to_string(recording.actions.size() + 1) + ": " + e.what());
  }
  return recording;
}

}  // namespace soda
