// Comparing hash logs.
#include <cinttypes>
#include <cstdio>
#include <fstream>
#include <optional>
#include <string>

#include "client/cli/diff_command.h"
#include "common/ids.h"

namespace soda::cli {
namespace {

struct Line {
  Step step = 0;
  std::uint64_t bodies = 0, hash = 0;
};

class Log {
 public:
  explicit Log(std::filesystem::path path) : path_(std::move(path)), file_(path_) {
    if (!file_) throw DiffError(path_.string() + ": cannot be read");
  }
  // The next line; none at the end.
  std::optional<Line> next() {
    std::string text;
    if (!std::getline(file_, text)) return std::nullopt;
    ++number_;
    Line line;
    int end = -1;
    if (std::sscanf(text.c_str(), "%" SCNd64 " %" SCNu64 " %" SCNx64 "%n", &line.step, &line.bodies, &line.hash,
                    &end) != 3 ||
        static_cast<std::size_t>(end) != text.size())
      throw DiffError(path_.string() + ":" + std::to_string(number_) + ": not a line of a hash log (STEP BODIES HASH)");
    if (last_ && line.step != *last_ + 1)
      throw DiffError(path_.string() + ":" + std::to_string(number_) + ": step " + std::to_string(line.step) +
                      " does not follow step " + std::to_string(*last_));
    last_ = line.step;
    return line;
  }

 private:
  std::filesystem::path path_;
  std::ifstream file_;
  int number_ = 0;
  std::optional<Step> last_;
};

}  // namespace

bool equal_logs(const std::filesystem::path& a, const std::filesystem::path& b) {
  Log log_a(a), log_b(b);
  Step compared = 0;
  for (;; ++compared) {
    const auto in_a = log_a.next(), in_b = log_b.next();
    if (compared == 0 && (!in_a || !in_b)) throw DiffError((in_a ? b : a).string() + ": is empty");
    if (!in_a && !in_b) break;
    if (!in_a || !in_b) {
      const Step first = (in_a ? in_a : in_b)->step;
      std::printf("equal up to step %" PRId64 ", where %s ends\n", first - 1, (in_a ? b : a).c_str());
      return false;
    }
    if (in_a->step != in_b->step)
      throw DiffError("the logs begin at different steps, " + std::to_string(in_a->step) + " and " +
                      std::to_string(in_b->step));
    if (in_a->bodies != in_b->bodies || in_a->hash != in_b->hash) {
      std::printf("step %" PRId64 " is the first to differ:\n  %s: %" PRIu64 " bodies, %016" PRIx64 "\n  %s: %" PRIu64
                  " bodies, %016" PRIx64 "\n",
                  in_a->step, a.c_str(), in_a->bodies, in_a->hash, b.c_str(), in_b->bodies, in_b->hash);
      return false;
    }
  }
  std::printf("equal: %" PRId64 " steps\n", compared);
  return true;
}

}  // namespace soda::cli
