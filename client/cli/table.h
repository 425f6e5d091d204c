// What one sees during a run: a table that is refreshed in place on a terminal, else a line now and then.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "client/cli/collector.h"

namespace soda::cli {

class Table {
 public:
  using Clock = std::chrono::steady_clock;

  // On standard error; `quiet`: only lines of text, no progress.
  explicit Table(bool quiet);
  ~Table() { clear(); }
  Table(const Table&) = delete;
  Table& operator=(const Table&) = delete;

  // Draws if it is time to.
  void update(const Collector& collector);
  // A line of text, above the table.
  void say(const std::string& line);
  // Takes the table away.
  void clear();

 private:
  // Steps per second over about the last second.
  struct Speed {
    Clock::time_point then{};
    Step final_step = 0;
    double steps_per_second = 0;
    double at(Clock::time_point now, Step final_now);
  };

  void draw(const Collector& collector, Clock::time_point now, double speed);
  void print_line(const Collector& collector, Clock::time_point now, double speed);

  const bool quiet_;
  const bool terminal_;
  Clock::time_point next_{};
  std::vector<Speed> speeds_;
  Speed total_;
  int drawn_ = 0;  // lines on the screen
};

// What there is to say at the end, on standard output.
void print_summary(const Collector& collector, bool complete);

// "preparing", "ready", "running", "done".
const char* state_name(std::uint8_t state);

}  // namespace soda::cli
