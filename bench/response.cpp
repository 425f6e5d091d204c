// `soda-bench response`: how long it takes from a user's push until it shows. A session in real time over DDS, one push
// after another at random moments: until it is answered, until its step is displayed, and until the world has told
// viewers a state of that step in which the body has the push's velocity.
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <map>
#include <mutex>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "bench/commands.h"
#include "bench/program.h"
#include "common/actions/action_proto.h"
#include "common/dds/participant.h"
#include "common/scene/generators.h"
#include "common/scene/scene_file.h"

namespace soda::bench {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

double ms(Clock::duration d) { return std::chrono::duration<double, std::milli>(d).count(); }

// What a client sees of a session.
class Client {
 public:
  explicit Client(const std::string& session)
      : participant_({}, session, "soda-bench"),
        answers_(participant_, dds::answer_topic(),
                 [this](wire::Answer&& answer, const dds::WriterKey&) {
                   const std::lock_guard lock(mutex_);
                   if (answer.client() == kClient && answer.number() == number_) answered_ = {Clock::now(), answer};
                   changed_.notify_all();
                 }),
        control_(participant_, dds::control_topic(),
                 [this](wire::Control&& control, const dds::WriterKey&) {
                   const std::lock_guard lock(mutex_);
                   displayed_ = control.phase() == wire::PHASE_RUNNING ? control.displayed() : -1;
                   shown_.emplace(displayed_, Clock::now());
                   changed_.notify_all();
                 }),
        transforms_(participant_, dds::transforms_topic(),
                    [this](wire::Transforms&& sample, const dds::WriterKey&) {
                      const std::lock_guard lock(mutex_);
                      const auto at = std::find(sample.ids().begin(), sample.ids().end(), body_) - sample.ids().begin();
                      if (at < std::ssize(sample.ids()) && sample.step() >= step_ && step_ > 0 &&
                          sample.velocities()[6 * at + 2] > kSpeed / 2)
                        seen_.emplace(sample.step(), Clock::now());
                      changed_.notify_all();
                    }),
        requests_(participant_, dds::request_topic()) {}

  bool wait_running(std::chrono::seconds at_most) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, at_most, [this] { return displayed_ > 30; });
  }

  struct Times {
    double answered, displayed, seen;  // ms after the request
  };
  // Pushes the body upwards, to kSpeed; nothing if it was refused or something is missing.
  std::optional<Times> push(BodyId body, double mass) {
    wire::Request request;
    request.client(kClient);
    request.kind(wire::REQUEST_ACTION);
    const std::string bytes = encode_action({0, 1, Push{body, Vec3(0, 0, kSpeed * mass), Vec3::Zero()}});
    request.action().assign(bytes.begin(), bytes.end());
    std::unique_lock lock(mutex_);
    request.number(++number_);
    answered_.reset();
    seen_.clear();
    shown_.clear();
    body_ = body, step_ = 0;
    lock.unlock();
    const auto began = Clock::now();
    requests_.write(request);
    lock.lock();
    if (!changed_.wait_for(lock, 5s, [this] { return answered_.has_value(); }) || !answered_->second.accepted())
      return std::nullopt;
    step_ = answered_->second.step();
    const auto shown = [this] {
      return std::find_if(shown_.begin(), shown_.end(), [this](auto& s) { return s.first >= step_; });
    };
    if (!changed_.wait_for(lock, 5s, [&] { return shown() != shown_.end() && !seen_.empty(); })) return std::nullopt;
    return Times{ms(answered_->first - began), ms(shown()->second - began), ms(seen_.begin()->second - began)};
  }

 private:
  static constexpr std::uint64_t kClient = 4711;
  static constexpr double kSpeed = 6;  // m/s
  std::mutex mutex_;
  std::condition_variable changed_;
  Step displayed_ = -1;
  std::uint64_t number_ = 0;
  std::optional<std::pair<Clock::time_point, wire::Answer>> answered_;
  std::map<Step, Clock::time_point> shown_, seen_;
  BodyId body_ = 0;
  Step step_ = 0;
  dds::Participant participant_;
  dds::Reader<wire::Answer> answers_;
  dds::Reader<wire::Control> control_;
  dds::Reader<wire::Transforms> transforms_;
  dds::Writer<wire::Request> requests_;
};

double quantile(std::vector<double> values, double q) {
  std::sort(values.begin(), values.end());
  return values.at(static_cast<std::size_t>(q * static_cast<double>(values.size() - 1) + 0.5));
}

void measure(const Options& options, int lead, Csv& csv, Headline& headline) {
  const int pushes = options.quick ? 5 : 200;
  const auto folder = std::filesystem::temp_directory_path() / ("soda-response-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  const Scene scene = generate("city", 600, 1);
  save_scene(scene, folder / "city.scene");
  const std::string session = "response-" + std::to_string(getpid()) + "-" + std::to_string(lead);
  std::vector<double> answered, displayed, seen;
  {
    const Program run({"run", (folder / "city.scene").string(), "--session", session, "--worlds", "2", "--input-lead",
                       std::to_string(lead), "--steps", "1000000", "-q"});
    Client client(session);
    if (!client.wait_running(60s)) throw std::runtime_error("the session does not start");
    std::mt19937 random(1);
    for (int i = 0; i < pushes; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100 + random() % 100));
      const Body& body = scene.bodies[300 + random() % 300];  // of the crowd
      const auto times = client.push(body.id, body.inertial.mass);
      if (!times) continue;
      answered.push_back(times->answered), displayed.push_back(times->displayed), seen.push_back(times->seen);
      csv.row(lead, times->answered, times->displayed, times->seen);
      std::printf("\r\x1b[2Klead %d: push %d of %d", lead, i + 1, pushes);
      std::fflush(stdout);
    }
  }
  std::filesystem::remove_all(folder);
  if (answered.size() < static_cast<std::size_t>(pushes) * 9 / 10) throw std::runtime_error("too few pushes were seen");
  std::printf("\r\x1b[2Klead %d: displayed after %.0f ms (median), %.0f ms (p99)\n", lead, quantile(displayed, 0.5),
              quantile(displayed, 0.99));
  const std::string key = "lead_" + std::to_string(lead) + ".";
  headline.add(key + "answered_ms_median", quantile(answered, 0.5));
  headline.add(key + "answered_ms_p99", quantile(answered, 0.99));
  headline.add(key + "told_ms_median", quantile(seen, 0.5));
  headline.add(key + "told_ms_p99", quantile(seen, 0.99));
  headline.add(key + "displayed_ms_median", quantile(displayed, 0.5));
  headline.add(key + "displayed_ms_p99", quantile(displayed, 0.99));
}

}  // namespace

void response(const Options& options, Headline& headline) {
  Csv csv(options, "response", "lead,answered_ms,displayed_ms,told_ms");
  for (const int lead : {2, 4}) measure(options, lead, csv, headline);
  csv.close();
  plot(options, "response",
       "set title 'from a push until it is displayed, real time, 2 worlds'\n"
       "set xlabel 'ms'\nset ylabel 'pushes'\nset key top right\nset style fill solid 0.5\nbin(x) = 8 * floor(x / 8) + "
       "4\n"
       "set boxwidth 8\nset datafile separator ','\n"
       "plot 'response.csv' using ($1 == 2 ? bin($3) : 1/0):(1) smooth freq with boxes title 'input lead 2 steps', "
       "'' using ($1 == 4 ? bin($3) : 1/0):(1) smooth freq with boxes title '4 steps'\n");
}

}  // namespace soda::bench
