#include "bench/message_costs.h"

#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "bench/harness.h"
#include "common/cpu_clock.h"
#include "server/world/dds_transport.h"

namespace soda::bench {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

// Bytes: an empty message, what borders send as datagrams, and what they send reliably.
constexpr std::size_t kSizes[] = {128, 2048, 8192, 16000, 17000, 60000};
constexpr std::size_t kFarewell = 1;
constexpr int kRounds = 7;
constexpr int kBurst = 8;  // messages at once: a world tells its neighbours what it has computed

struct End {
  End(const std::string& session, WorldId me)
      : participant(options(), session, "soda-bench"), transport(participant, me) {
    const WorldId other = 1 - me;
    transport.open(std::span(&other, 1));
  }
  static dds::NetworkOptions options() {
    dds::NetworkOptions network;
    network.shared_memory = false;  // the machines of a cluster have none in common
    return network;
  }
  // The next message; none where nothing comes for so long.
  std::optional<std::vector<std::byte>> next(Clock::duration at_most) {
    const auto until = Clock::now() + at_most;
    while (Clock::now() < until) {
      if (auto incoming = transport.receive()) {
        if (incoming->kind == world::Incoming::Kind::kMessage) return std::move(incoming->bytes);
      } else {
        transport.wait(100ms);
      }
    }
    return std::nullopt;
  }
  dds::Participant participant;
  world::DdsTransport transport;
};

// Sends everything back.
void echo(const std::string& session) {
  End end(session, 1);
  while (auto bytes = end.next(20s)) {
    if (bytes->size() == kFarewell) break;
    end.transport.send(0, std::move(*bytes));
  }
}

double process_seconds() {
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

struct Sample {
  double bytes, one_way, send, receive;  // s
};

// `burst` messages at once, to the other process and back; again and again. A burst of which something is missing does
// not count: who is kept from acknowledging for long is sent no more for a while, and what was to be sent is dropped.
Sample measure(End& end, std::size_t bytes, int burst, int bursts) {
  std::vector<double> round_trips, sending, receiving;
  static std::uint32_t number = 0;  // of the burst, in its messages
  for (int missed = 0; std::ssize(round_trips) < bursts;) {
    ++number;
    const double before = process_seconds(), send_begun = cpu_seconds();
    const auto sent_at = Clock::now();
    for (int k = 0; k < burst; ++k) {
      std::vector<std::byte> message(bytes);
      std::memcpy(message.data(), &number, sizeof number);
      end.transport.send(1, std::move(message));
    }
    const double sent = cpu_seconds() - send_begun;
    int back = 0;
    while (back < burst) {
      const auto message = end.next(1s);
      if (!message) break;
      back += std::memcmp(message->data(), &number, sizeof number) == 0;
    }
    if (back < burst) {
      constexpr int kMissedAtMost = 20;
      if (++missed > kMissedAtMost) throw std::runtime_error("messages to another process on this machine get lost");
      continue;
    }
    sending.push_back(sent);
    round_trips.push_back(std::chrono::duration<double>(Clock::now() - sent_at).count());
    // What is not sending is receiving, on whichever thread.
    receiving.push_back(process_seconds() - before - sent);
  }
  return {static_cast<double>(bytes), median(round_trips) / 2, median(sending) / burst, median(receiving) / burst};
}

}  // namespace

Network measure_messages(bool quick) {
  const std::string session = "soda-bench-" + std::to_string(getpid());
  std::fflush(stdout);
  const pid_t other = fork();
  if (other < 0) throw std::runtime_error("cannot start a process");
  if (other == 0) {
    int status = 1;
    try {
      echo(session);
      status = 0;
    } catch (const std::exception& error) {
      std::fprintf(stderr, "soda-bench: %s\n", error.what());
    }
    _exit(status);
  }
  const struct Ends {
    pid_t process;
    ~Ends() {
      kill(process, SIGTERM);
      waitpid(process, nullptr, 0);
    }
  } ends{other};
  std::vector<Sample> samples;
  {
    End end(session, 0);
    for (int i = 0; i < 2000 && !end.transport.connected(); ++i) std::this_thread::sleep_for(10ms);
    if (!end.transport.connected()) throw std::runtime_error("two processes on this machine do not meet over DDS");
    const int bursts = quick ? 20 : 200;
    (void)measure(end, kSizes[0], 1, bursts);  // until both are warm
    // Of several rounds the best: on a machine that others use, too, all else is theirs.
    for (const std::size_t bytes : kSizes) {
      Sample best{static_cast<double>(bytes), HUGE_VAL, HUGE_VAL, HUGE_VAL};
      for (int round = 0; round < kRounds; ++round) {
        const Sample alone = measure(end, bytes, 1, bursts), many = measure(end, bytes, kBurst, bursts);
        best.one_way = std::min(best.one_way, alone.one_way);
        best.send = std::min(best.send, many.send);
        best.receive = std::min(best.receive, many.receive);
      }
      samples.push_back(best);
    }
    end.transport.send(1, std::vector<std::byte>(kFarewell));
    end.transport.flush(5s);
  }
  for (const Sample& s : samples)
    std::printf(
        "a message of %6.0f bytes over DDS, UDP: %3.0f us on its way; CPU %3.0f us to send, %3.0f us to receive\n",
        s.bytes, 1e6 * s.one_way, 1e6 * s.send, 1e6 * s.receive);
  Network network;
  network.latency = samples.front().one_way;
  std::vector<CostBySize::Known> send, receive;
  for (const Sample& s : samples) {
    send.push_back({s.bytes, s.send});
    receive.push_back({s.bytes, s.receive});
  }
  network.send = CostBySize(std::move(send));
  network.receive = CostBySize(std::move(receive));
  return network;
}

}  // namespace soda::bench
