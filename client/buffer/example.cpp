// The buffer interface by example: follows a session, and says four times a second which body is highest now, and which
// one will be at the newest step that all worlds have computed.
//
//   buffer_example SESSION [SECONDS]
#include <chrono>
#include <cstdio>
#include <cstdlib>

#include "client/buffer/session_client.h"

using namespace std::chrono_literals;
using soda::buffer::Pose;

namespace {

void say_highest(const char* when, const soda::buffer::TransformBuffer& buffer, soda::Step step) {
  const soda::buffer::View view = buffer.at(step);
  if (view.step < 0) return;
  soda::BodyId highest = 0;
  double z = -1e300;
  for (const auto& poses : view.worlds)
    poses.for_each([&](std::uint32_t body, const auto& pose) {
      if (pose->position[2] <= z) return;
      z = pose->position[2];
      highest = buffer.bodies().id(body);
    });
  std::printf("%s, step %lld%s: body %llu at %.2f m\n", when, static_cast<long long>(view.step),
              view.anticipated ? " (may still change)" : "", static_cast<unsigned long long>(highest), z);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: buffer_example SESSION [SECONDS]\n");
    return 2;
  }
  soda::buffer::SessionClient client({}, argv[1]);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(argc > 2 ? std::atoi(argv[2]) : 10);
  auto next = std::chrono::steady_clock::now();
  while (std::chrono::steady_clock::now() < end && client.ended().empty()) {
    client.poll(50ms);
    if (!client.buffer() || std::chrono::steady_clock::now() < next) continue;
    next += 250ms;
    say_highest("now", *client.buffer(), client.displayed());
    say_highest("to come", *client.buffer(), client.buffer()->newest());
  }
  return 0;
}
