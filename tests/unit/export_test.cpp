// Recordings as glTF: read back by assimp, a small run has its meshes, bodies and motion, in y-up axes, from the first
// key to the last. What cannot be is refused, and no file is ever there in part.
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <gtest/gtest.h>

#include <assimp/Importer.hpp>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "client/export/glb.h"
#include "common/atomic_file.h"
#include "common/scene/scene_file.h"
#include "common/scene_hash.h"
#include "tests/unit/scene_support.h"

namespace soda::test {
namespace {

constexpr Step kLast = 20, kEvery = 2;
constexpr double kDt = 0.125;  // s
enum : BodyId { kFaller = 1, kSleeper, kHammer, kJumper, kGround, kPlane, kSpawned };

// Four dynamic bodies on two static ones; a ball comes at step 5 and goes with step 14; one body is put elsewhere.
class Export : public testing::Test {
 protected:
  Export() {
    SceneBuilder builder("a run");
    builder.scene.dt = kDt;
    builder.add(Box{Vec3(1, 1, 1)}, Vec3(0, 0, 10)).name = "faller";
    builder.add(Box{Vec3(1, 1, 1)}, Vec3(3, 4, 0.5)).name = "sleeper";
    Body& hammer = builder.add(Cylinder{0.1, 1}, Vec3(-5, 0, 1));
    hammer.shapes.push_back({builder.geometry(Box{Vec3(1, 1, 1)}), Pose{Vec3(0, 0, 1), Quat::Identity()}});
    builder.add(Box{Vec3(1, 1, 1)}, Vec3(8, 8, 0.5)).colour = 0xff000080;
    builder.add_ground(50);
    builder.add_static(Plane{}, Vec3(0, 0, -1));
    scene = builder.finish();
    SceneBuilder ball("ball");
    ball.add(Sphere{0.3}, Vec3(1, 2, 6));
    Scene spawned = ball.finish();
    spawned.bodies[0].id = kSpawned;
    log = {{1, 5, Spawn{std::make_shared<const Scene>(spawned)}},
           {2, 14, Remove{kSpawned}},
           {3, 9, SetPose{kJumper, Vec3(-8, 8, 2), Quat::Identity()}}};
  }

  // The recording: the faller sinks 1 m each sample and turns about z, from step 12 on so far that its quaternion comes
  // with the other sign; the sleeper moves at steps 12 and 14 only; the ball sinks; the others rest.
  void record(const std::function<void(pb::RecordedPoses&)>& change = {}) {
    const std::string encoded = encode_scene(scene);
    RecordingWriter writer(file("a.rec"));
    writer.begin(scene_hash(encoded), encoded, {});
    for (const LoggedAction& entry : log) writer.add_action(entry.number, encode_action(entry));
    for (Step step = 0; step <= kLast; ++step) {
      if (step <= known) writer.add_digest(step, {4, 1});
      if (step % kEvery != 0) continue;
      pb::RecordedPoses poses;
      poses.set_step(step);
      const double turn = 0.1 * static_cast<double>(step), sign = step >= 12 ? -1 : 1;
      add(poses, kFaller, Vec3(0, 0, 10 - 0.5 * static_cast<double>(step)),
          Quat(sign * std::cos(turn), 0, 0, sign * std::sin(turn)));
      if (step == 0)
        for (std::size_t i = 1; i < 4; ++i) add(poses, scene.bodies[i].id, display(i), Quat::Identity());
      if (step == 12) add(poses, kSleeper, Vec3(3, 5, 0.5), Quat::Identity());
      if (step == 14) add(poses, kSleeper, Vec3(3, 6, 0.5), Quat::Identity());
      if (step == 10) add(poses, kJumper, Vec3(-8, 8, 2), Quat::Identity());
      if (step >= 6 && step <= 14) add(poses, kSpawned, Vec3(1, 2, 11 - static_cast<double>(step)), Quat::Identity());
      if (change) change(poses);
      writer.add_poses(std::move(poses));
    }
    writer.close(known == kLast);
  }
  static void add(pb::RecordedPoses& poses, BodyId id, const Vec3& x, const Quat& q) {
    poses.add_ids(id);
    for (int i = 0; i < 3; ++i) poses.add_values(static_cast<float>(x[i]));
    for (int i = 0; i < 4; ++i) poses.add_values(static_cast<float>(q.coeffs()[i]));
  }
  Vec3 display(std::size_t body) const {
    return scene.bodies[body].pose.position + scene.bodies[body].inertial.centre;  // none is turned
  }

  std::string file(const char* name) const { return (folder.path / name).string(); }
  gltf::Tracks tracks(const gltf::Range& range = {}) {
    recording = load_recording(file("a.rec"), true);
    return gltf::tracks_of(recording, file("a.rec"), range);
  }
  const aiScene* exported(const gltf::Range& range = {}) {
    const gltf::Tracks all = tracks(range);
    summary = gltf::write_glb(all, recording.scene, file("a.glb"));
    EXPECT_EQ(summary.bytes, std::filesystem::file_size(file("a.glb")));
    const aiScene* back = importer.ReadFile(file("a.glb"), aiProcess_ValidateDataStructure);
    if (!back) throw std::runtime_error(importer.GetErrorString());
    return back;
  }
  static const aiNodeAnim* channel(const aiScene& back, const std::string& node) {
    if (back.mNumAnimations == 0) return nullptr;
    for (unsigned i = 0; i < back.mAnimations[0]->mNumChannels; ++i)
      if (back.mAnimations[0]->mChannels[i]->mNodeName.C_Str() == node) return back.mAnimations[0]->mChannels[i];
    return nullptr;
  }
  static const gltf::Track& track(const gltf::Tracks& tracks, BodyId id) {
    for (const gltf::Track& t : tracks.bodies)
      if (t.body->id == id) return t;
    throw std::out_of_range("body");
  }

  TemporaryFolder folder;
  Scene scene;
  std::vector<LoggedAction> log;
  Step known = kLast;  // of the steps after it there are poses only
  Recording recording;
  gltf::GlbSummary summary;
  Assimp::Importer importer;
};

void expect_at(const aiVector3D& v, const Vec3& expected) {
  EXPECT_NEAR(v.x, expected.x(), 1e-5);
  EXPECT_NEAR(v.y, expected.y(), 1e-5);
  EXPECT_NEAR(v.z, expected.z(), 1e-5);
}

// Seconds; assimp counts in ticks.
double time_of(const aiScene& scene, double ticks) { return ticks / scene.mAnimations[0]->mTicksPerSecond; }

TEST_F(Export, HasTheMeshesAndBodiesOfTheRun) {
  record();
  const aiScene& back = *exported();
  // Shapes: cube, hammer, ground, plane, ball. A cube has its own colour, and so have bodies without one of the
  // scene's.
  EXPECT_EQ(summary.meshes, 5u);
  EXPECT_EQ(back.mNumMeshes, 7u);
  EXPECT_EQ(summary.bodies, 7u);
  ASSERT_EQ(back.mRootNode->mNumChildren, 7u);
  EXPECT_STREQ(back.mRootNode->mName.C_Str(), "a run");
  for (unsigned i = 0; i < 7; ++i) EXPECT_EQ(back.mRootNode->mChildren[i]->mNumMeshes, 1u);
  aiColor4D colour;
  const aiNode& jumper = *back.mRootNode->FindNode("body 4");
  ASSERT_EQ(back.mMaterials[back.mMeshes[jumper.mMeshes[0]]->mMaterialIndex]->Get(AI_MATKEY_BASE_COLOR, colour),
            aiReturn_SUCCESS);
  EXPECT_EQ(colour, aiColor4D(1, 0, 0, 128 / 255.f));
}

TEST_F(Export, WhatIsEqualIsThereOnce) {
  record();
  exported();
  const std::string bytes = read_file(file("a.glb"));
  std::uint32_t length = 0;  // of the JSON, after three words of the header
  std::memcpy(&length, bytes.data() + 12, sizeof length);
  const auto json = nlohmann::json::parse(bytes.substr(20, length));
  std::set<int> positions, times;
  for (const auto& mesh : json["meshes"]) positions.insert(mesh["primitives"][0]["attributes"]["POSITION"].get<int>());
  EXPECT_EQ(json["meshes"].size(), 7u);  // by shape and colour
  EXPECT_EQ(positions.size(), 5u);
  const auto& animation = json["animations"][0];
  for (const auto& sampler : animation["samplers"]) times.insert(sampler["input"].get<int>());
  EXPECT_EQ(animation["samplers"].size(), 6u);  // the faller turns, too; the ball has sizes
  EXPECT_EQ(times.size(), 5u);
  // The samples, of which the sleeper has three in a row; jumper, ball, and the ball's sizes.
  const int view = json["accessors"][*times.begin()]["bufferView"];
  EXPECT_EQ(json["bufferViews"][view]["byteLength"], sizeof(float) * (11 + 2 + 6 + 3));
}

TEST_F(Export, IsYUp) {
  record();
  const aiScene& back = *exported();
  // 10 m up, and 4 m to the north, which is away from who looks along -z.
  expect_at(back.mRootNode->mTransformation * aiVector3D(0, 0, 10), Vec3(0, 10, 0));
  expect_at(back.mRootNode->mTransformation * aiVector3D(3, 4, 0.5), Vec3(3, 0.5, -4));
  // The hammer's node is at its centre of mass, its mesh about it: the head's top is where it was, 1.5 m above the
  // middle of the handle.
  const aiNode& hammer = *back.mRootNode->FindNode("body 3");
  const aiMesh& mesh = *back.mMeshes[hammer.mMeshes[0]];
  double top = -1e9;
  for (unsigned i = 0; i < mesh.mNumVertices; ++i)
    top = std::max<double>(top, (back.mRootNode->mTransformation * (hammer.mTransformation * mesh.mVertices[i])).y);
  EXPECT_NEAR(top, 2.5, 1e-5);
}

TEST_F(Export, BodiesMoveAsRecorded) {
  record();
  const aiScene& back = *exported();
  ASSERT_EQ(back.mNumAnimations, 1u);
  EXPECT_EQ(summary.animated, 4u);
  EXPECT_EQ(back.mAnimations[0]->mNumChannels, 4u);  // assimp has one for each node
  EXPECT_EQ(channel(back, "body 3"), nullptr);
  EXPECT_EQ(channel(back, "ground"), nullptr);

  const aiNodeAnim* faller = channel(back, "faller");
  ASSERT_NE(faller, nullptr);
  ASSERT_EQ(faller->mNumPositionKeys, 11u);
  const auto& last = faller->mPositionKeys[10];
  expect_at(faller->mPositionKeys[0].mValue, Vec3(0, 0, 10));
  EXPECT_EQ(time_of(back, faller->mPositionKeys[0].mTime), 0);
  expect_at(back.mRootNode->mTransformation * last.mValue, Vec3(0, 0, 0));
  EXPECT_NEAR(time_of(back, last.mTime), kLast * kDt, 1e-6);
  ASSERT_EQ(faller->mNumRotationKeys, 11u);
  for (unsigned i = 0; i < 11; ++i) {
    const aiQuaternion& q = faller->mRotationKeys[i].mValue;
    EXPECT_NEAR(q.w, std::cos(0.2 * i), 1e-6);  // on one side all the way
    EXPECT_NEAR(q.z, std::sin(0.2 * i), 1e-6);
  }
}

TEST_F(Export, WhoRestsIsHeldUntilItMoves) {
  record();
  const gltf::Tracks all = tracks();
  EXPECT_EQ(track(all, kSleeper).steps, (std::vector<std::uint32_t>{10, 12, 14}));
  EXPECT_EQ(track(all, kSleeper).positions.front(), (std::array<float, 3>{3, 4, 0.5}));
  EXPECT_EQ(track(all, kSleeper).positions.back(), (std::array<float, 3>{3, 6, 0.5}));
  EXPECT_TRUE(track(all, kHammer).steps.empty());
  EXPECT_TRUE(track(all, kGround).steps.empty());
  const aiNodeAnim* sleeper = channel(*exported(), "sleeper");
  ASSERT_NE(sleeper, nullptr);
  EXPECT_EQ(sleeper->mNumPositionKeys, 3u);
  EXPECT_EQ(sleeper->mNumRotationKeys, 1u);  // assimp's own: that of the node
}

TEST_F(Export, WhoRestsBetweenTwoMovesHasKeysAtBothEnds) {
  record([](pb::RecordedPoses& poses) {
    if (poses.step() == 20) add(poses, kSleeper, Vec3(0, 6, 0.5), Quat::Identity());
  });
  EXPECT_EQ(track(tracks(), kSleeper).steps, (std::vector<std::uint32_t>{10, 12, 14, 18, 20}));
}

TEST_F(Export, WhoIsPutElsewhereDoesNotGlideThere) {
  record();
  const gltf::Tracks all = tracks();
  const gltf::Track& jumper = track(all, kJumper);
  EXPECT_EQ(jumper.steps, (std::vector<std::uint32_t>{9, 10}));
  EXPECT_EQ(jumper.positions[0], (std::array<float, 3>{8, 8, 0.5}));
  EXPECT_EQ(jumper.positions[1], (std::array<float, 3>{-8, 8, 2}));
}

TEST_F(Export, WhatIsSpawnedAndRemovedIsThereInBetween) {
  record();
  const gltf::Tracks all = tracks();
  const gltf::Track& ball = track(all, kSpawned);
  EXPECT_EQ(ball.appears, 5u);
  EXPECT_EQ(ball.vanishes, std::optional<std::uint32_t>(15));
  EXPECT_EQ(ball.start.position, (std::array<float, 3>{1, 2, 6}));
  EXPECT_EQ(ball.steps, (std::vector<std::uint32_t>{5, 6, 8, 10, 12, 14}));
  const aiScene& back = *exported();
  const aiNodeAnim* scales = channel(back, "body 7");
  ASSERT_NE(scales, nullptr);
  ASSERT_EQ(scales->mNumScalingKeys, 3u);
  const double steps[] = {0, 5, 15};
  const float sizes[] = {0, 1, 0};
  for (unsigned i = 0; i < 3; ++i) {
    EXPECT_NEAR(time_of(back, scales->mScalingKeys[i].mTime), steps[i] * kDt, 1e-6);
    EXPECT_EQ(scales->mScalingKeys[i].mValue, aiVector3D(sizes[i]));
  }
}

TEST_F(Export, APartBeginsWhereItBegins) {
  record();
  // From step 13 (whose last sample is 12) to 17 (16).
  const gltf::Tracks part = tracks({.from = 13, .to = 17});
  EXPECT_EQ(part.first, 12);
  EXPECT_EQ(part.last(), 16);
  EXPECT_EQ(part.samples, (std::vector<std::uint32_t>{0, 2, 4}));
  EXPECT_EQ(track(part, kFaller).start.position, (std::array<float, 3>{0, 0, 4}));
  EXPECT_EQ(track(part, kFaller).steps, (std::vector<std::uint32_t>{0, 2, 4}));
  EXPECT_EQ(track(part, kJumper).start.position, (std::array<float, 3>{-8, 8, 2}));
  EXPECT_TRUE(track(part, kJumper).steps.empty());
  EXPECT_EQ(track(part, kSpawned).appears, 0u);
  EXPECT_EQ(track(part, kSpawned).vanishes, std::optional<std::uint32_t>(3));
  // Before it was spawned, and after it was removed, there is no ball.
  EXPECT_THROW(track(tracks({.from = 0, .to = 4}), kSpawned), std::out_of_range);
  EXPECT_THROW(track(tracks({.from = 16}), kSpawned), std::out_of_range);
  const aiScene& back = *exported({.from = 13, .to = 17});
  EXPECT_NEAR(time_of(back, channel(back, "faller")->mPositionKeys[2].mTime), 4 * kDt, 1e-6);
}

TEST_F(Export, FewerSamplesStillEndAtTheEnd) {
  record();
  const gltf::Tracks few = tracks({.every = 7});
  EXPECT_EQ(few.samples, (std::vector<std::uint32_t>{0, 8, 16, 20}));
  EXPECT_EQ(track(few, kFaller).steps, few.samples);
  EXPECT_EQ(track(few, kSleeper).steps, (std::vector<std::uint32_t>{8, 16}));
  EXPECT_EQ(track(few, kJumper).steps, (std::vector<std::uint32_t>{9, 10}));
  EXPECT_EQ(tracks({.every = 100}).samples, (std::vector<std::uint32_t>{0, 20}));
}

TEST_F(Export, ARecordingThatIsCutShortIsExportedUpToTheCut) {
  known = 11;
  log.resize(1);  // what was done to bodies later is not in it, but poses are
  record([](pb::RecordedPoses& poses) {
    if (poses.step() == 14) add(poses, 99, Vec3::Zero(), Quat::Identity());
  });
  const gltf::Tracks all = tracks();
  EXPECT_NE(recording.cut, "");
  EXPECT_EQ(all.last(), 10);
  EXPECT_EQ(track(all, kFaller).steps.back(), 10u);
  EXPECT_EQ(tracks({.to = kLast}).last(), 10);
  EXPECT_THROW(tracks({.from = 12}), std::invalid_argument);
}

TEST_F(Export, BadRangesAreRefused) {
  record();
  EXPECT_THROW(tracks({.from = kLast + 1}), std::invalid_argument);
  EXPECT_THROW(tracks({.from = 9, .to = 8}), std::invalid_argument);
  EXPECT_THROW(tracks({.from = -1}), std::invalid_argument);
  EXPECT_THROW(tracks({.every = 0}), std::invalid_argument);
  EXPECT_EQ(tracks({.to = kLast + 100}).last(), kLast);
}

TEST_F(Export, PosesThatCannotBeAreRefused) {
  const auto refused = [&](Step step, const std::function<void(pb::RecordedPoses&)>& change, const std::string& why) {
    record([&](pb::RecordedPoses& poses) {
      if (poses.step() == step) change(poses);
    });
    try {
      tracks();
      ADD_FAILURE() << "not refused: " << why;
    } catch (const RecordingError& e) {
      EXPECT_NE(std::string(e.what()).find(why), std::string::npos) << e.what();
      EXPECT_EQ(std::string(e.what()).find(file("a.rec")), 0u) << e.what();
    }
  };
  const auto add_one = [](BodyId id, const Vec3& x, const Quat& q) {
    return [=](pb::RecordedPoses& poses) { add(poses, id, x, q); };
  };
  const Quat none = Quat::Identity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  refused(4, add_one(99, Vec3::Zero(), none), "body 99");
  refused(4, add_one(kGround, Vec3::Zero(), none), "body 5");
  refused(4, add_one(kSpawned, Vec3::Zero(), none), "body 7 is not there then");
  refused(16, add_one(kSpawned, Vec3::Zero(), none), "body 7 is not there then");
  refused(4, add_one(kHammer, Vec3(nan, 0, 0), none), "not finite");
  refused(4, add_one(kHammer, Vec3::Zero(), Quat(0.9, 0, 0, 0)), "unit quaternion");
  refused(
      4, [](pb::RecordedPoses& poses) { poses.add_values(1); }, "seven numbers");
  refused(
      4, [](pb::RecordedPoses& poses) { poses.set_step(2); }, "not in order");
}

TEST_F(Export, ARecordingWithoutPosesIsRefused) {
  const std::string encoded = encode_scene(scene);
  RecordingWriter writer(file("a.rec"));
  writer.begin(scene_hash(encoded), encoded, {});
  writer.add_digest(0, {4, 1});
  writer.close(true);
  EXPECT_THROW(tracks(), RecordingError);
}

TEST_F(Export, TimesThatFloatCannotTellApartAreRefused) {
  scene.dt = 1e-6;
  record();
  gltf::Tracks all = tracks();
  all.samples.push_back(1'000'000'000);  // 1000 s, where float has steps of 6e-5 s
  EXPECT_THROW(gltf::write_glb(all, recording.scene, file("a.glb")), std::invalid_argument);
}

TEST_F(Export, TheFileIsThereWholeOrAsItWas) {
  record();
  const gltf::Tracks all = tracks();
  const auto files = [&] {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder.path)) names.insert(entry.path().filename());
    return names;
  };
  struct GivenUp {};
  const auto give_up = [](std::size_t, std::size_t) { throw GivenUp{}; };
  EXPECT_THROW(gltf::write_glb(all, recording.scene, file("a.glb"), give_up), GivenUp);
  EXPECT_EQ(files(), (std::set<std::string>{"a.rec"}));
  std::ofstream(file("a.glb")) << "as it was";
  EXPECT_THROW(gltf::write_glb(all, recording.scene, file("a.glb"), give_up), GivenUp);
  EXPECT_EQ(read_file(file("a.glb")), "as it was");
  EXPECT_THROW(gltf::write_glb(all, recording.scene, folder.path / "nowhere" / "a.glb"), FileError);
  std::filesystem::create_directory(file("b.glb"));
  EXPECT_THROW(gltf::write_glb(all, recording.scene, file("b.glb")), FileError);
  EXPECT_EQ(files(), (std::set<std::string>{"a.glb", "a.rec", "b.glb"}));
  std::size_t done = 0, total = 1;
  gltf::write_glb(all, recording.scene, file("a.glb"), [&](std::size_t d, std::size_t t) { done = d, total = t; });
  EXPECT_EQ(done, total);
  EXPECT_EQ(read_file(file("a.glb")).substr(0, 4), "glTF");
  EXPECT_EQ(files(), (std::set<std::string>{"a.glb", "a.rec", "b.glb"}));
}

TEST_F(Export, WhereNothingMovesThereIsNoAnimation) {
  record();
  gltf::Tracks all = tracks({.to = 0});
  gltf::write_glb(all, recording.scene, file("a.glb"));
  const aiScene* back = importer.ReadFile(file("a.glb"), aiProcess_ValidateDataStructure);
  ASSERT_NE(back, nullptr) << importer.GetErrorString();
  EXPECT_EQ(back->mNumAnimations, 0u);
}

}  // namespace
}  // namespace soda::test
