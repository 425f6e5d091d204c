// Whole states in a file, for finding the first bit in which two runs differ.
//
// Layout, everything little-endian:
//   8 bytes "SODADUMP", u32 version, u32 sizeof(BodyState), u32 sizeof(ContactRecord), u32 0, u64 scene hash,
//   i64 first step, i64 last step; then for each step
//   i64 step, u64 bodies, u64 contacts, u64 full_hash of both, the BodyStates ascending by id, the ContactRecords in
//   canonical order (record_before), both as raw memory.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <stdexcept>

#include "common/body_set.h"
#include "common/ids.h"

namespace soda {

// what() names the file.
struct DumpError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct DumpHeader {
  std::uint64_t scene_hash = 0;
  Step first = 0, last = 0;
};

struct DumpStep {
  Step step = 0;
  BodySet state;
};

class DumpWriter {
 public:
  // Creates the file at once. Throws DumpError.
  DumpWriter(std::filesystem::path path, const DumpHeader& header);
  // Steps in order, from header.first on. Throws DumpError.
  void add(Step step, const BodySet& state);
  void close();  // throws DumpError if anything could not be written

 private:
  std::filesystem::path path_;
  std::ofstream file_;
};

class DumpReader {
 public:
  // Throws DumpError for what is not a dump, or of another version.
  explicit DumpReader(std::filesystem::path path);
  const DumpHeader& header() const { return header_; }
  // The next step; none after the last. Throws DumpError where the file is truncated or damaged.
  std::optional<DumpStep> next();

 private:
  std::filesystem::path path_;
  std::ifstream file_;
  std::uintmax_t left_ = 0;  // bytes of the file behind what was read
  DumpHeader header_;
};

// Whether the file begins like a dump.
bool is_dump(const std::filesystem::path& path);

}  // namespace soda
