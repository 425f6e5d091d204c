// Wire types as bytes: what is encoded is decoded; whatever else comes is refused, without a crash and without taking
// the memory that it claims to need.
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <limits>
#include <numeric>
#include <random>
#include <thread>

#include "common/dds/cdr.h"
#include "common/dds/checks.h"
#include "common/dds/frames.h"
#include "common/grid.h"
#include "common/version.h"

namespace soda::dds {
namespace {

wire::Session good_session() {
  wire::Session s;
  s.protocol(kProtocolVersion);
  s.version("1.2.3");
  s.instance(7);
  s.scene_name("demo");
  s.scene_hash(8);
  s.scene_bytes(1000);
  s.worlds(4);
  s.last_step(600);
  s.sync(wire::SYNC_CONSERVATIVE);
  s.window(48);
  s.lead(6);
  s.dt(1.0 / 60);
  s.dump_first(-1);
  s.dump_last(-1);
  return s;
}

wire::Digests good_digests() {
  wire::Digests s;
  s.instance(7);
  s.world(2);
  s.first(10);
  s.bodies({1, 2, 3});
  s.hashes({4, 5, 6});
  return s;
}

wire::StateChunk good_state() {
  wire::StateChunk s;
  s.bodies_total(2);
  s.contacts_total(1);
  s.bodies().resize(120);
  return s;
}

wire::Transforms good_transforms() {
  wire::Transforms s;
  s.world(1);
  s.number(3);
  s.kind(wire::VIEW_STEP);
  s.ids({4, 9, 17});
  s.positions(std::vector<double>(9, 0.5));
  s.orientations(std::vector<float>(12, 0.5f));
  s.velocities(std::vector<float>(18, 0.25f));
  s.flags({1, 2, 3});
  s.gone({5});
  return s;
}

wire::Transfer good_transfer() {
  wire::Transfer s;
  s.instance(7);
  s.world(1);
  s.number(3);
  s.step(90);
  s.taker(2);
  s.cells({4, 9, 17});
  return s;
}

wire::Border good_border() {
  wire::Border s;
  s.from(1);
  s.to(2);
  s.payload({1, 2, 3, 4, 5});
  return s;
}

wire::Poses good_poses() {
  wire::Poses s;
  s.world(1);
  s.step(30);
  s.total(2);
  s.ids({4, 9});
  s.values(std::vector<float>(14, 0.5f));
  return s;
}

wire::Request good_request() {
  wire::Request s;
  s.client(5);
  s.number(1);
  s.action({1, 2, 3});
  return s;
}

wire::LogEntry good_entry() {
  wire::LogEntry s;
  s.number(1);
  s.action({1, 2, 3});
  return s;
}

template <class T>
void expect_round_trip(const T& sample) {
  T back;
  EXPECT_EQ(decode(encode(sample), back), "");
  EXPECT_EQ(back, sample);
}

TEST(Wire, ComesBack) {
  expect_round_trip(good_session());
  expect_round_trip(good_digests());
  expect_round_trip(good_state());
  expect_round_trip(good_transforms());
  expect_round_trip(good_transfer());
  expect_round_trip(good_border());
  expect_round_trip(good_poses());
  expect_round_trip(good_request());
  expect_round_trip(good_entry());
  expect_round_trip(wire::Control());
  expect_round_trip(wire::Answer());
  expect_round_trip(wire::Status());
}

template <class T>
void expect_never_crashes(const T& sample) {
  const std::vector<std::byte> good = encode(sample);
  for (std::size_t length = 0; length < good.size(); ++length) {
    T out;
    EXPECT_NE(decode(std::span(good).first(length), out), "") << length << " of " << good.size();
  }
  std::mt19937 random(1);
  for (int round = 0; round < 20000; ++round) {
    std::vector<std::byte> bad = good;
    for (int n = 0; n < 3; ++n)
      bad[random() % bad.size()] = static_cast<std::byte>(random() % 3 == 0 ? 0xff : random());
    T out;
    (void)decode(std::span<const std::byte>(bad), out);
  }
}

TEST(Wire, TruncatedOrScrambledIsRefusedOrHarmless) {
  expect_never_crashes(good_digests());
  expect_never_crashes(good_state());
  expect_never_crashes(good_transforms());
  expect_never_crashes(good_transfer());
  expect_never_crashes(good_border());
  expect_never_crashes(good_poses());
  expect_never_crashes(good_request());
  expect_never_crashes(good_entry());
}

// A sequence that claims four thousand million elements in a sample of a few bytes would have Fast CDR allocate them.
TEST(Wire, LengthsBeyondTheEndAreRefusedBeforeMemoryIsTaken) {
  std::vector<std::byte> border = encode(good_border());
  for (std::size_t i = 12; i < 16; ++i) border[i] = std::byte{0xff};  // encapsulation, from, to, then the length
  wire::Border out;
  EXPECT_EQ(decode(std::span<const std::byte>(border), out), "a length beyond the end");
  EXPECT_LT(out.payload().capacity(), 1000u);
}

TEST(Wire, AnotherVersionPassesWithItsVersionOnly) {
  wire::Session other = good_session();
  other.protocol(kProtocolVersion + 1);
  std::vector<std::byte> bytes = encode(other);
  bytes.resize(8);  // whatever it looks like behind
  wire::Session out;
  EXPECT_EQ(decode(std::span<const std::byte>(bytes), out), "");
  EXPECT_EQ(out.protocol(), kProtocolVersion + 1);
  EXPECT_EQ(out.instance(), 0u);
}

TEST(Wire, ImpossibleValuesAreRefused) {
  const auto refused = [](auto sample, const auto& spoil) {
    EXPECT_EQ(problem(sample), "");
    spoil(sample);
    EXPECT_NE(problem(sample), "");
  };
  refused(good_session(), [](auto& s) { s.worlds(0); });
  refused(good_session(), [](auto& s) { s.worlds(kMaxWorlds + 1); });
  refused(good_session(), [](auto& s) { s.instance(0); });
  refused(good_session(), [](auto& s) { s.last_step(-1); });
  refused(good_session(), [](auto& s) { s.sync(9); });
  refused(good_session(), [](auto& s) { s.dt(std::numeric_limits<double>::quiet_NaN()); });
  refused(good_session(), [](auto& s) { s.pace(-1); });
  refused(good_session(), [](auto& s) { s.scene_name(std::string(kMaxText + 1, 'x')); });
  refused(good_digests(), [](auto& s) { s.hashes().pop_back(); });
  refused(good_digests(), [](auto& s) { s.first(-1); });
  refused(good_digests(), [](auto& s) { s.world(kMaxWorlds); });
  refused(good_state(), [](auto& s) { s.bodies().resize(119); });
  refused(good_state(), [](auto& s) { s.bodies_total(0); });
  refused(good_transforms(), [](auto& s) { s.positions()[5] = std::numeric_limits<double>::infinity(); });
  refused(good_transforms(), [](auto& s) { s.velocities()[17] = std::numeric_limits<float>::quiet_NaN(); });
  refused(good_transforms(), [](auto& s) { s.orientations().pop_back(); });
  refused(good_transforms(), [](auto& s) { s.flags().pop_back(); });
  refused(good_transforms(), [](auto& s) { s.kind(3); });
  refused(good_transforms(), [](auto& s) { s.number(0); });
  refused(good_transfer(), [](auto& s) { s.world(kMaxWorlds); });
  refused(good_transfer(), [](auto& s) { s.taker(kMaxWorlds); });
  refused(good_transfer(), [](auto& s) { s.taker(1); });  // itself
  refused(good_transfer(), [](auto& s) { s.number(0); });
  refused(good_transfer(), [](auto& s) { s.step(0); });  // the initial territories say who owns what there
  refused(good_transfer(), [](auto& s) { s.step(kMaxStepNumber + 1); });
  refused(good_transfer(), [](auto& s) { s.cells().clear(); });
  refused(good_transfer(), [](auto& s) { s.cells({4, 4}); });
  refused(good_transfer(), [](auto& s) { s.cells({9, 4}); });
  refused(good_transfer(), [](auto& s) { s.cells({kMaxCells}); });
  refused(good_transfer(), [](auto& s) {
    s.cells().resize(kMaxTransferCells + 1);
    std::iota(s.cells().begin(), s.cells().end(), 0u);
  });
  refused(good_border(), [](auto& s) { s.to(kMaxWorlds); });
  refused(good_session(), [](auto& s) { s.lead(0); });
  refused(good_poses(), [](auto& s) { s.ids().pop_back(); });
  refused(good_poses(), [](auto& s) { s.total(1); });
  refused(good_poses(), [](auto& s) { s.values()[9] = std::numeric_limits<float>::quiet_NaN(); });
  refused(good_request(), [](auto& s) { s.client(0); });
  refused(good_request(), [](auto& s) { s.kind(77); });
  refused(good_request(), [](auto& s) { s.value(-1); });
  refused(good_entry(), [](auto& s) { s.number(0); });
  refused(wire::Answer(), [](auto& s) { s.step(-1); });
  refused(wire::Control(), [](auto& s) { s.closed(-1); });
  refused(wire::Control(), [](auto& s) { s.phase(5); });
  refused(wire::Status(), [](auto& s) { s.state(9); });
  refused(wire::Status(), [](auto& s) { s.final_step(5); });  // beyond the clock
}

TEST(Wire, SessionNamesAreNoPatterns) {
  EXPECT_TRUE(good_session_name("Demo_1.a-b"));
  for (const char* const bad : {"", "*", "a?", "a b", "ä", "a/b", "[ab]"}) EXPECT_FALSE(good_session_name(bad)) << bad;
  EXPECT_FALSE(good_session_name(std::string(65, 'a')));
  EXPECT_NO_THROW(check_session_name("demo"));
  EXPECT_THROW(check_session_name("a/b"), std::invalid_argument);
}

class Pipe {
 public:
  Pipe() { EXPECT_EQ(::pipe(fds_.data()), 0); }
  ~Pipe() { close_in(), ::close(fds_[0]); }
  int out() const { return fds_[0]; }
  int in() const { return fds_[1]; }
  void close_in() {
    if (fds_[1] >= 0) ::close(fds_[1]);
    fds_[1] = -1;
  }

 private:
  std::array<int, 2> fds_{};
};

TEST(Frames, ReportsGoThroughAPipeInOrder) {
  constexpr int kReports = 2000;  // more than a pipe holds
  Pipe pipe;
  std::thread writer([&] {
    FrameWriter out(pipe.in());
    out.write(good_session());
    for (int i = 0; i < kReports; ++i) {
      wire::Digests digests = good_digests();
      digests.first(i);
      out.write(digests);
    }
    pipe.close_in();
  });
  FrameReader in(pipe.out());
  const auto first = in.next(std::chrono::seconds(5));
  ASSERT_TRUE(first && std::holds_alternative<wire::Session>(*first));
  for (int i = 0; i < kReports; ++i) {
    const auto report = in.next(std::chrono::seconds(5));
    ASSERT_TRUE(report && std::holds_alternative<wire::Digests>(*report)) << i;
    EXPECT_EQ(std::get<wire::Digests>(*report).first(), i);
  }
  EXPECT_FALSE(in.next(std::chrono::seconds(5)));
  EXPECT_TRUE(in.closed());
  writer.join();
}

TEST(Frames, NonsenseIsRefused) {
  Pipe pipe;
  const std::array<std::uint32_t, 4> nonsense{99, 4, 0, 0};
  ASSERT_EQ(::write(pipe.in(), nonsense.data(), sizeof nonsense), static_cast<ssize_t>(sizeof nonsense));
  FrameReader in(pipe.out());
  EXPECT_THROW((void)in.next(std::chrono::seconds(1)), std::runtime_error);
}

}  // namespace
}  // namespace soda::dds
