#include "common/dump.h"

#include <array>
#include <bit>
#include <cstring>
#include <string>
#include <utility>

#include "common/state_hash.h"

namespace soda {
namespace {

static_assert(std::endian::native == std::endian::little, "dumps are little-endian memory");

constexpr std::array<char, 8> kMagic = {'S', 'O', 'D', 'A', 'D', 'U', 'M', 'P'};
constexpr std::uint32_t kDumpVersion = 1;

struct FileHeader {
  std::array<char, 8> magic = kMagic;
  std::uint32_t version = kDumpVersion;
  std::uint32_t body_bytes = sizeof(BodyState), contact_bytes = sizeof(ContactRecord), unused = 0;
  std::uint64_t scene_hash = 0;
  std::int64_t first = 0, last = 0;
};
static_assert(sizeof(FileHeader) == 48);

struct StepHeader {
  std::int64_t step = 0;
  std::uint64_t bodies = 0, contacts = 0, hash = 0;
};

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& why) {
  throw DumpError(path.string() + ": " + why);
}

template <class T>
void put(std::ofstream& file, const T* values, std::size_t count) {
  file.write(reinterpret_cast<const char*>(values), static_cast<std::streamsize>(count * sizeof(T)));
}

template <class T>
bool get(std::ifstream& file, T* values, std::size_t count) {
  return static_cast<bool>(file.read(reinterpret_cast<char*>(values), static_cast<std::streamsize>(count * sizeof(T))));
}

}  // namespace

DumpWriter::DumpWriter(std::filesystem::path path, const DumpHeader& header)
    : path_(std::move(path)), file_(path_, std::ios::binary | std::ios::trunc) {
  FileHeader out;
  out.scene_hash = header.scene_hash;
  out.first = header.first;
  out.last = header.last;
  put(file_, &out, 1);
  if (!file_) fail(path_, "cannot be written");
}

void DumpWriter::add(Step step, const BodySet& state) {
  const StepHeader out{step, state.bodies.size(), state.contacts.size(), full_hash(state)};
  put(file_, &out, 1);
  put(file_, state.bodies.data(), state.bodies.size());
  put(file_, state.contacts.data(), state.contacts.size());
  if (!file_) fail(path_, "cannot be written");
}

void DumpWriter::close() {
  file_.close();
  if (!file_) fail(path_, "cannot be written");
}

DumpReader::DumpReader(std::filesystem::path path) : path_(std::move(path)), file_(path_, std::ios::binary) {
  if (!file_) fail(path_, "cannot be read");
  std::error_code error;
  left_ = std::filesystem::file_size(path_, error);
  FileHeader in;
  if (error || left_ < sizeof in || !get(file_, &in, 1) || in.magic != kMagic) fail(path_, "is not a dump");
  if (in.version != kDumpVersion || in.body_bytes != sizeof(BodyState) || in.contact_bytes != sizeof(ContactRecord))
    fail(path_, "is a dump of another version (" + std::to_string(in.version) + ", this is " +
                    std::to_string(kDumpVersion) + ")");
  if (in.first < 0 || in.last < in.first) fail(path_, "has an impossible range of steps");
  left_ -= sizeof in;
  header_ = {in.scene_hash, in.first, in.last};
}

std::optional<DumpStep> DumpReader::next() {
  if (left_ == 0) return std::nullopt;
  StepHeader in;
  if (left_ < sizeof in || !get(file_, &in, 1)) fail(path_, "is truncated");
  left_ -= sizeof in;
  // Before anything is allocated.
  if (in.bodies > left_ / sizeof(BodyState) ||
      in.contacts > (left_ - in.bodies * sizeof(BodyState)) / sizeof(ContactRecord))
    fail(path_, "is truncated at step " + std::to_string(in.step));
  DumpStep out;
  out.step = in.step;
  out.state.bodies.resize(in.bodies);
  out.state.contacts.resize(in.contacts);
  if (!get(file_, out.state.bodies.data(), in.bodies) || !get(file_, out.state.contacts.data(), in.contacts))
    fail(path_, "is truncated at step " + std::to_string(in.step));
  left_ -= in.bodies * sizeof(BodyState) + in.contacts * sizeof(ContactRecord);
  if (full_hash(out.state) != in.hash) fail(path_, "is damaged at step " + std::to_string(in.step));
  return out;
}

bool is_dump(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::array<char, 8> magic{};
  return get(file, magic.data(), magic.size()) && magic == kMagic;
}

}  // namespace soda
