// Border messages over DDS: order, size, and honesty about what may have been lost.
#include <gtest/gtest.h>

#include <memory>
#include <thread>

#include "server/world/dds_transport.h"
#include "tests/distributed/dds_test_support.h"

namespace soda::world {
namespace {

using namespace std::chrono_literals;

// Two worlds, each with its own participant.
class Transports : public ::testing::TestWithParam<bool> {
 protected:
  Transports() {
    test::use_transports_within_process();
    network_.shared_memory = GetParam();
    network_.lease = 2;
  }

  struct End {
    End(const dds::NetworkOptions& network, const std::string& session, WorldId me, WorldId other)
        : participant(network, session, "test"), transport(participant, me) {
      transport.open(std::span(&other, 1));
    }
    dds::Participant participant;
    DdsTransport transport;
  };
  std::unique_ptr<End> make(WorldId me) const { return std::make_unique<End>(network_, session_, me, 1 - me); }

  static bool meet(const End& a, const End& b) {
    for (int i = 0; i < 1000 && !(a.transport.connected() && b.transport.connected()); ++i)
      std::this_thread::sleep_for(10ms);
    return a.transport.connected() && b.transport.connected();
  }
  // The next thing that comes.
  static std::optional<Incoming> next(End& end, std::chrono::milliseconds within) {
    const auto until = std::chrono::steady_clock::now() + within;
    while (std::chrono::steady_clock::now() < until) {
      if (auto incoming = end.transport.receive()) return incoming;
      end.transport.wait(10ms);
    }
    return std::nullopt;
  }
  static std::vector<std::byte> message(std::size_t bytes, std::uint32_t number) {
    std::vector<std::byte> m(bytes);
    for (std::size_t i = 0; i < bytes; ++i) m[i] = static_cast<std::byte>((i * 2654435761u + number) >> 13);
    return m;
  }

  dds::NetworkOptions network_;
  const std::string session_ = test::unique_session();
};

TEST_P(Transports, EightMebibytesArriveWhole) {
  auto a = make(0), b = make(1);
  ASSERT_TRUE(meet(*a, *b));
  for (std::uint32_t i = 0; i < 5; ++i) {
    const auto sent = message((std::size_t{8} << 20) + i, i);
    a->transport.send(1, sent);
    const auto got = next(*b, 20s);
    ASSERT_TRUE(got) << i;
    ASSERT_EQ(got->kind, Incoming::Kind::kMessage);
    EXPECT_EQ(got->from, 0u);
    EXPECT_TRUE(got->bytes == sent) << i;
  }
}

// In order, but for what gets lost: then the sender goes back, as the core does. Long and short ones go different ways.
TEST_P(Transports, ThousandsArriveInOrder) {
  auto a = make(0), b = make(1);
  ASSERT_TRUE(meet(*a, *b));
  constexpr std::uint32_t kMessages = 5000;
  const auto nth = [](std::uint32_t i) { return message(i % 100 == 50 ? 200'000 : 200, i); };
  std::uint32_t sent = 0, got = 0;
  const auto until = std::chrono::steady_clock::now() + 60s;
  while (got < kMessages && std::chrono::steady_clock::now() < until) {
    while (const auto back = a->transport.receive())
      if (back->kind == Incoming::Kind::kInterrupted) sent = got;
    for (; sent < kMessages && sent < got + 20; ++sent) a->transport.send(1, nth(sent));
    const auto incoming = next(*b, 100ms);
    if (!incoming) sent = got;
    if (!incoming || incoming->kind != Incoming::Kind::kMessage) continue;
    if (incoming->bytes == nth(got)) {
      ++got;
      continue;
    }
    bool again = false;
    for (std::uint32_t i = got > 40 ? got - 40 : 0; i < got; ++i) again = again || incoming->bytes == nth(i);
    ASSERT_TRUE(again) << "out of order at " << got;
  }
  EXPECT_EQ(got, kMessages);
}

TEST_P(Transports, WhatIsSentBeforeTheMeetingArrives) {
  auto a = make(0);
  for (std::uint32_t i = 0; i < 10; ++i) a->transport.send(1, message(1000, i));
  auto b = make(1);
  for (std::uint32_t i = 0; i < 10; ++i) {
    const auto got = next(*b, 10s);
    ASSERT_TRUE(got) << i;
    EXPECT_TRUE(got->bytes == message(1000, i)) << i;
  }
}

TEST_P(Transports, ANeighbourThatComesBackIsAnInterruption) {
  auto a = make(0), b = make(1);
  ASSERT_TRUE(meet(*a, *b));
  b.reset();
  std::this_thread::sleep_for(200ms);
  a->transport.send(1, message(100, 1));  // goes nowhere
  b = make(1);
  const auto got = next(*a, 10s);
  ASSERT_TRUE(got);
  EXPECT_EQ(got->kind, Incoming::Kind::kInterrupted);
  EXPECT_EQ(got->from, 1u);
  // What is sent again after the last interruption arrives.
  a->transport.send(1, message(100, 2));
  bool arrived = false;
  for (int i = 0; i < 500 && !arrived; ++i) {
    while (const auto again = a->transport.receive())
      if (again->kind == Incoming::Kind::kInterrupted) a->transport.send(1, message(100, 2));
    const auto incoming = next(*b, 20ms);
    arrived = incoming && incoming->bytes == message(100, 2);
  }
  EXPECT_TRUE(arrived);
}

// Whoever is in the session can write to a world's datagrams.
TEST_P(Transports, StrangersAreRefused) {
  auto a = make(0), b = make(1);
  ASSERT_TRUE(meet(*a, *b));
  dds::Participant stranger(network_, session_, "stranger");
  dds::Writer<wire::Border> writer(stranger, dds::border_datagram_topic(1));
  for (int i = 0; i < 1000 && !writer.matched(); ++i) std::this_thread::sleep_for(10ms);
  ASSERT_TRUE(writer.matched());
  wire::Border sample;
  sample.from(7);
  sample.to(1);
  sample.payload({1, 2, 3});
  const std::uint64_t before = dds::refusals().count();
  // Not every one need arrive.
  for (int i = 0; i < 1000 && dds::refusals().count() == before; ++i) {
    ASSERT_TRUE(writer.write(sample));
    ASSERT_FALSE(next(*b, 10ms));
  }
  EXPECT_GT(dds::refusals().count(), before);
  const auto sent = message(100, 1);
  a->transport.send(1, sent);
  const auto got = next(*b, 10s);
  ASSERT_TRUE(got);
  EXPECT_TRUE(got->bytes == sent);
}

TEST_P(Transports, FlushWaitsForAcknowledgements) {
  auto a = make(0), b = make(1);
  ASSERT_TRUE(meet(*a, *b));
  for (std::uint32_t i = 0; i < 20; ++i) a->transport.send(1, message(100000, i));
  const auto began = std::chrono::steady_clock::now();
  a->transport.flush(10s);
  EXPECT_LT(std::chrono::steady_clock::now() - began, 8s);
  for (std::uint32_t i = 0; i < 20; ++i) ASSERT_TRUE(b->transport.receive()) << i;
}

INSTANTIATE_TEST_SUITE_P(Wire, Transports, ::testing::Values(true, false),
                         [](const auto& test) { return test.param ? "SharedMemory" : "Udp"; });

}  // namespace
}  // namespace soda::world
