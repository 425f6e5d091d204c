#include "bench/harness.h"

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <iostream>
#include <stdexcept>

namespace soda::bench {

void Headline::print() const {
  for (const auto& [key, value] : numbers_) std::printf("%-44s %.6g\n", key.c_str(), value);
}

void Headline::write(const std::filesystem::path& file) const {
  std::ofstream out(file);
  out.precision(10);
  out << "{";
  const char* separator = "\n";
  for (const auto& [key, value] : numbers_) out << separator << "  \"" << key << "\": " << value, separator = ",\n";
  out << "\n}\n";
  if (!out.flush()) throw std::runtime_error("cannot write " + file.string());
}

Csv::Csv(const Options& options, const std::string& name, const std::string& header) {
  if (options.out.empty()) return;
  const std::filesystem::path file = options.out / (name + ".csv");
  file_.open(file);
  if (!file_) throw std::runtime_error("cannot write " + file.string());
  file_.precision(8);
  file_ << header << '\n';
}

void plot(const Options& options, const std::string& name, const std::string& script, int width, int height) {
  if (options.out.empty()) return;
  const auto quoted = [](const std::filesystem::path& path) {
    std::string text = "'";
    for (const char c : path.string()) text += c == '\'' ? std::string("''") : std::string(1, c);
    return text + "'";
  };
  const std::string size = std::to_string(width) + "," + std::to_string(height);
  FILE* gnuplot = popen("gnuplot", "w");
  std::string all = "cd " + quoted(std::filesystem::absolute(options.out)) + "\nset datafile separator ','\n";
  for (const auto& [terminal, ending] :
       {std::pair("svg background 'white' font 'sans,13'", "svg"), std::pair("pngcairo font 'sans,11'", "png")})
    all += "reset session\nset datafile separator ','\nset terminal " + std::string(terminal) + " size " + size +
           "\nset output '" + name + "." + ending + "'\n" + script + "\nunset output\n";
  const bool written = gnuplot && std::fputs(all.c_str(), gnuplot) >= 0;
  if (!written || pclose(gnuplot) != 0) std::cerr << "no picture " << name << ": gnuplot failed or is not installed\n";
}

std::filesystem::path soda_program() { return std::filesystem::read_symlink("/proc/self/exe").parent_path() / "soda"; }

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

}  // namespace soda::bench
