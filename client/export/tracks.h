// A recording by body instead of by step: when each body is there, and where it is when.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "common/recording/recording.h"

namespace soda::gltf {

// Which part of a recording, in its steps.
struct Range {
  Step from = 0;                // begins at the last sample that is not after it
  std::optional<Step> to = {};  // ends at the last sample that is not after it; the recording's end if not given
  Step every = 1;               // samples at least that far apart are taken
};

struct TrackPose {
  std::array<float, 3> position{};     // m, of the centre of mass, world
  std::array<float, 4> orientation{};  // unit quaternion x, y, z, w: body frame to world
  bool operator==(const TrackPose&) const = default;
};

// Steps in tracks are counted from the first sample. A body is where the line between two keys is; before its first key
// it is at `start`, after the last one it stays. A body that rests has keys only at both ends of its rest.
struct Track {
  const Scene* scene = nullptr;  // that has the body's shapes
  const Body* body = nullptr;
  TrackPose start;
  std::uint32_t appears = 0;              // 0: there from the start
  std::optional<std::uint32_t> vanishes;  // the first step at which it is no more
  std::vector<std::uint32_t> steps;       // of the keys, ascending
  std::vector<std::array<float, 3>> positions;
  std::vector<std::array<float, 4>> orientations;  // each on the side of the one before it: q and -q are one rotation
};

struct Tracks {
  Step first = 0;                      // of the recording: step 0 of the tracks
  std::vector<std::uint32_t> samples;  // ascending from 0
  std::vector<Track> bodies;           // those that are there at some sample: the scene's, then spawned ones
  Step last() const { return first + samples.back(); }
};

// Is told how far something that takes long has come. May throw, to end it.
using Progress = std::function<void(std::size_t done, std::size_t total)>;

// Takes the recording's poses out of it as it goes, so that there is no second copy of them; points into the rest of
// it. `name` of the file, for errors; `progress` gets samples. Throws RecordingError for a recording without poses, or
// with poses that cannot be, and std::invalid_argument for a range that is not in it.
Tracks tracks_of(Recording& recording, const std::string& name, const Range& range, const Progress& progress = {});

}  // namespace soda::gltf
