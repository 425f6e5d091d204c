// What all benchmarks share: options, headline numbers, tables, pictures, clocks.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "common/cpu_clock.h"

namespace soda::bench {

struct Options {
  std::filesystem::path out;       // directory for CSV files and pictures; made when missing; empty: none are written
  std::filesystem::path json;      // file for the headline numbers; empty: none
  bool quick = false;              // smaller and shorter: to see that it works, not to measure
  int rounds = 0;                  // repetitions; 0: the command's own choice
  std::vector<std::string> cases;  // of `accuracy`; empty: all
  std::vector<unsigned> worlds;    // of `accuracy`: compare bits on so many worlds instead; of `scaling`: no others
  bool distribution = false;       // of `accuracy`: the error of distribution instead
};

// The headline numbers of a run: printed at the end and written as one flat JSON object, in the order added.
class Headline {
 public:
  void add(const std::string& key, double value) { numbers_.emplace_back(key, value); }
  void print() const;
  void write(const std::filesystem::path& file) const;

 private:
  std::vector<std::pair<std::string, double>> numbers_;
};

// A CSV file in the output directory; does nothing where there is none.
class Csv {
 public:
  Csv(const Options& options, const std::string& name, const std::string& header);
  void close() { file_.close(); }  // before a picture is made of it
  template <typename... Cells>
  void row(const Cells&... cells) {
    if (!file_.is_open()) return;
    const char* separator = "";
    ((file_ << separator << cells, separator = ","), ...);
    file_ << '\n';
  }

 private:
  std::ofstream file_;
};

// Draws NAME.svg and NAME.png in the output directory with a gnuplot script (without terminal and output, relative to
// that directory). Says so where gnuplot is missing; does nothing where there is no output directory.
void plot(const Options& options, const std::string& name, const std::string& script, int width = 800,
          int height = 500);

// The command beside this program.
std::filesystem::path soda_program();

double median(std::vector<double> values);

// Median CPU seconds per call of f, over enough calls to be measurable.
template <typename F>
double time_of(F&& f, int repetitions = 21) {
  std::vector<double> seconds;
  for (int i = 0; i < repetitions; ++i) {
    const double start = cpu_seconds();
    f();
    seconds.push_back(cpu_seconds() - start);
  }
  return median(std::move(seconds));
}

}  // namespace soda::bench
