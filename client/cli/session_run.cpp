#include "client/cli/session_run.h"

#include <chrono>
#include <csignal>
#include <utility>

#include "client/cli/explanation.h"
#include "client/cli/stats_file.h"

namespace soda::cli {
namespace {

using namespace std::chrono_literals;

constexpr auto kPoll = 50ms;
constexpr auto kEndAtMost = 15s;  // for daemons to end by themselves once the session is over
constexpr auto kStopAtMost = 5s;  // for daemons to end when asked to
constexpr auto kLongStart = 10s;  // without a word of the session
constexpr auto kGoneAfter = 15s;  // for a session that was not started here
constexpr auto kLastWords = 3s;   // for reports under way, once every daemon has ended

// Says how a daemon ended that should not have, with the end of its log.
void say_ended(Table& table, const Ended& ended) {
  table.say(ended.name + " " + ended.reason + (ended.last_lines.empty() ? "" : "; its last words:"));
  for (const std::string& line : ended.last_lines) table.say("  " + line);
}

class Follower {
 public:
  Follower(ReportSource& source, Processes& processes, Table& table, StopSignals& signals, Collector& collector)
      : source_(source), processes_(processes), table_(table), signals_(signals), collector_(collector) {}

  int run() {
    const bool own = processes_.running() > 0;
    const auto began = Clock::now();
    auto last_end = began;
    bool known = false;  // or said that it is not
    for (;;) {
      hear();
      collector_.tick();
      if (!known && (collector_.session() || Clock::now() - began > kLongStart)) {
        known = true;
        if (!collector_.session())
          table_.say(own ? "nothing has been heard of the worlds for 10 s; still waiting (-v shows what they say)"
                         : "nothing has been heard of this session for 10 s; still waiting");
      }
      if (!collector_.difference().empty()) return kExitDifferent;
      if (collector_.complete()) return let_end();
      if (signals_.received() != 0) return 128 + signals_.received();
      for (const Ended& ended : processes_.poll()) {
        last_end = Clock::now();
        if (ended.exit_code != 0) return failed(ended);
      }
      table_.update(collector_);
      if (!own && collector_.silent_for(kGoneAfter)) {
        table_.say("the session is gone: nothing has come from any of its worlds for some time");
        return kExitFailed;
      }
      if (own && processes_.running() == 0 && (source_.closed() || Clock::now() - last_end > kLastWords)) {
        table_.say("the daemons have ended, but not all that they computed was heard of");
        return kExitFailed;
      }
    }
  }

 private:
  using Clock = std::chrono::steady_clock;

  void hear() {
    const auto until = Clock::now() + kPoll;
    for (auto at_most = kPoll; auto report = source_.next(at_most);) {
      collector_.add(std::move(*report));
      if (collector_.complete() || Clock::now() >= until) return;
      at_most = 0ms;
    }
  }

  int failed(const Ended& ended) {
    say_ended(table_, ended);
    return ended.exit_code == kExitBadInput ? kExitBadInput : kExitFailed;
  }

  // The session is over; the daemons end by themselves.
  int let_end() {
    const auto until = Clock::now() + kEndAtMost;
    int code = kExitOk;
    while (processes_.running() > 0 && Clock::now() < until && signals_.received() == 0) {
      for (const Ended& ended : processes_.poll())
        if (ended.exit_code != 0) code = failed(ended);
      (void)source_.next(10ms);
    }
    if (processes_.running() > 0 && signals_.received() == 0) table_.say("some daemons did not end by themselves");
    return code;
  }

  ReportSource& source_;
  Processes& processes_;
  Table& table_;
  StopSignals& signals_;
  Collector& collector_;
};

}  // namespace

int follow(ReportSource& source, Processes& processes, Table& table, StopSignals& signals, Collector& collector,
           const FollowOptions& options) {
  int code = kExitFailed;
  try {
    code = Follower(source, processes, table, signals, collector).run();
  } catch (const std::exception& e) {
    table.say(std::string("error: ") + e.what());
  }
  table.clear();
  const bool complete = collector.complete();
  // A daemon may be waiting for room in its pipe.
  // World 0 tells viewers which of the two it was.
  processes.stop(signals.received() != 0 ? SIGINT : SIGTERM, kStopAtMost, [&] {
    while (source.next(0ms)) {
    }
  });
  try {
    collector.close();
    if (!options.stats.empty()) write_stats(options.stats, collector, complete);
  } catch (const std::runtime_error& e) {  // a file that cannot be written
    table.say(std::string("error: ") + e.what());
    code = kExitFailed;
  }
  print_summary(collector, complete);
  if (options.explain) print_explanation(collector, options.substeps);
  return code;
}

void show_line(Table& table, const std::string& name, const std::string& line, bool verbose) {
  // The daemons put the letter of the level first. What has none did not come from the log, and is worth seeing.
  const bool logged = line.size() >= 2 && line[1] == ' ';
  const char level = logged ? line[0] : 'W';
  if (verbose || (level != 'D' && level != 'I' && level != 'T'))
    table.say(name + ": " + (logged ? line.substr(2) : line));
}

}  // namespace soda::cli
