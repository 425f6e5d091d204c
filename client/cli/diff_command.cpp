#include "client/cli/diff_command.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>

#include "client/cli/exit_code.h"
#include "common/dump.h"

namespace soda::cli {
namespace {

struct DiffOptions {
  std::string a, b;
};

int diff(const DiffOptions& o) {
  const bool dumps = is_dump(o.a);
  if (dumps != is_dump(o.b)) throw DiffError(o.a + " and " + o.b + ": one is a dump, the other is not");
  return (dumps ? equal_dumps(o.a, o.b) : equal_logs(o.a, o.b)) ? kExitEqual : kExitDifferent;
}

}  // namespace

void add_diff_command(CLI::App& app, int& exit_code) {
  auto o = std::make_shared<DiffOptions>();
  CLI::App* command = app.add_subcommand("diff", "find the first step, or body and field, in which two runs differ");
  command->add_option("a", o->a, "hash log or dump of a run")->required();
  command->add_option("b", o->b, "the same of another run")->required();
  command->footer("Exit codes: 0 equal, 1 different, 2 bad input.");
  // Whatever goes wrong is the fault of a file.
  command->callback([o, &exit_code] { exit_code = guarded([&] { return diff(*o); }, kExitBadInput); });
}

}  // namespace soda::cli
