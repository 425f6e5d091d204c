// Recordings: what is written comes back, and whatever is cut off or damaged is noticed.
#include "common/recording/recording.h"

#include <gtest/gtest.h>

#include <fstream>
#include <limits>

#include "common/scene/scene_file.h"
#include "common/scene_hash.h"
#include "tests/support/random_actions.h"
#include "tests/unit/scene_support.h"

namespace soda::test {
namespace {

constexpr Step kSteps = 6000;  // some blocks

class RecordingFile : public testing::Test {
 protected:
  RecordingFile() : scene(every_kind()), file((folder.path / "a.rec").string()) {
    const std::string encoded = encode_scene(scene);
    log = random_actions(scene, kSteps, 20, false, 4);
    RecordingWriter writer(file);
    pb::RecordedSettings settings;
    settings.set_worlds(3);
    settings.set_last_step(kSteps);
    writer.begin(scene_hash(encoded), encoded, settings);
    for (const LoggedAction& entry : log) writer.add_action(entry.number, encode_action(entry));
    for (Step step = 0; step <= kSteps; ++step) {
      digests.push_back({10, static_cast<std::uint64_t>(step) * 77});
      writer.add_digest(step, digests.back());
      if (step % 2 == 0) {
        pb::RecordedPoses poses;
        poses.set_step(step);
        poses.add_ids(static_cast<std::uint64_t>(step) + 1);
        for (int i = 0; i < 7; ++i) poses.add_values(i == 6 ? 1 : i < 3 ? static_cast<float>(i) : 0);
        writer.add_poses(std::move(poses));
      }
      writer.flush_if_due();
    }
    writer.close(true);
    bytes = read_file(file);
  }
  std::string write(const std::string& content) const {
    const std::string other = (folder.path / "b.rec").string();
    std::ofstream(other, std::ios::binary) << content;
    return other;
  }

  TemporaryFolder folder;
  Scene scene;
  std::string file, bytes;
  std::vector<LoggedAction> log;
  std::vector<StepDigest> digests;
};

TEST_F(RecordingFile, ComesBack) {
  const Recording back = load_recording(file, true);
  EXPECT_TRUE(back.complete);
  EXPECT_EQ(back.cut, "");
  EXPECT_EQ(back.digests, digests);
  EXPECT_EQ(back.settings.worlds(), 3u);
  EXPECT_EQ(encode_scene(back.scene), encode_scene(scene));
  ASSERT_EQ(back.actions.size(), log.size());
  for (std::size_t i = 0; i < log.size(); ++i) EXPECT_EQ(encode_action(back.actions[i]), encode_action(log[i]));
  EXPECT_EQ(back.poses.size(), static_cast<std::size_t>(kSteps / 2 + 1));
  EXPECT_TRUE(load_recording(file, false).poses.empty());
}

TEST_F(RecordingFile, CutOffAnywhereItIsGoodUpToThereOrRefused) {
  std::size_t good = 0, refused = 0;
  for (std::size_t n = 0; n < bytes.size(); n += bytes.size() / 300) {
    try {
      const Recording back = load_recording(write(bytes.substr(0, n)), true);
      EXPECT_FALSE(back.complete || back.damaged);
      EXPECT_NE(back.cut, "");
      ASSERT_LE(back.digests.size(), digests.size());
      for (std::size_t t = 0; t < back.digests.size(); ++t) ASSERT_EQ(back.digests[t], digests[t]);
      ++good;
    } catch (const RecordingError& e) {
      EXPECT_NE(std::string(e.what()).find("b.rec"), std::string::npos) << e.what();
      ++refused;
    }
  }
  EXPECT_GT(refused, 0u);
  EXPECT_GT(good, 0u);
}

TEST_F(RecordingFile, DamageIsNoticed) {
  std::size_t told = 0, good = 0;
  for (std::size_t at = 30; at < bytes.size(); at += bytes.size() / 300) {
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    try {
      const Recording back = load_recording(write(damaged), true);
      EXPECT_NE(back.cut, "") << "byte " << at;
      told += back.damaged;
      ++good;
    } catch (const RecordingError&) {
    }
  }
  EXPECT_GT(told, good / 2);  // the others look as if they ended early
  EXPECT_GT(told, 0u);
}

// A file with a good hash may still say nonsense.
TEST_F(RecordingFile, PosesAreChecked) {
  const auto refusal = [&](Step step, int values, float w) -> std::string {
    const std::string other = (folder.path / "c.rec").string();
    const std::string encoded = encode_scene(scene);
    RecordingWriter writer(other);
    writer.begin(scene_hash(encoded), encoded, {});
    for (Step t = 0; t <= 4; ++t) writer.add_digest(t, {1, 1});
    for (const Step at : {Step{2}, step}) {
      pb::RecordedPoses poses;
      poses.set_step(at);
      poses.add_ids(1);
      for (int i = 0; i < (at == 2 ? 7 : values); ++i) poses.add_values(i == 6 ? (at == 2 ? 1 : w) : 0);
      writer.add_poses(std::move(poses));
    }
    writer.close(true);
    try {
      const Recording back = load_recording(other, true);
      return std::to_string(back.poses.size()) + " poses";
    } catch (const RecordingError& e) {
      return e.what();
    }
  };
  const auto expect = [](const std::string& said, const std::string& text) {
    EXPECT_NE(said.find(text), std::string::npos) << said;
  };
  EXPECT_EQ(refusal(3, 7, 1), "2 poses");
  EXPECT_EQ(refusal(Step{1} << 50, 7, 1), "1 poses") << "after the last digest nothing is known";
  expect(refusal(1, 7, 1), "not in order");
  expect(refusal(3, 6, 1), "c.rec: poses at step 3: not seven numbers");
  expect(refusal(3, 7, 2), "body 1: its orientation is not a unit quaternion");
  expect(refusal(3, 7, std::numeric_limits<float>::quiet_NaN()), "not finite");
}

TEST_F(RecordingFile, OtherVersionsAndOtherFilesAreRefused) {
  std::string other = bytes;
  other[8] = 9;
  try {
    load_recording(write(other), false);
    FAIL();
  } catch (const RecordingError& e) {
    EXPECT_NE(std::string(e.what()).find("version 9"), std::string::npos) << e.what();
  }
  EXPECT_THROW(load_recording(write("no recording at all, but long enough"), false), RecordingError);
  EXPECT_THROW(load_recording(folder.path / "nowhere", false), RecordingError);
}

TEST(Recording, ASecondAtMostIsNotInTheFile) {
  TemporaryFolder folder;
  const Scene scene = every_kind();
  const std::string encoded = encode_scene(scene), file = (folder.path / "a.rec").string();
  RecordingWriter writer(file);
  writer.begin(scene_hash(encoded), encoded, {});
  // Blocks go to the file while it is open: what a killed process leaves behind.
  for (Step step = 0; step < 5000; ++step) {
    writer.add_digest(step, {1, 2});
    writer.flush_if_due();
  }
  const Recording back = load_recording(file, false);
  EXPECT_GE(back.digests.size(), 4000u);
  EXPECT_FALSE(back.complete);
}

}  // namespace
}  // namespace soda::test
