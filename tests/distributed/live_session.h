// A session that runs while a test does things to it.
#pragma once

#include <memory>

#include "tests/distributed/session.h"

namespace soda::test {

class LiveSession : public SessionTest {
 protected:
  // Starts a session that runs for `steps` in real time, and waits until it does.
  std::unique_ptr<Program> start(const std::string& file, int worlds, int steps, std::vector<std::string> more = {}) {
    std::vector<std::string> arguments{"run",        file,
                                       "--session",  session,
                                       "--worlds",   std::to_string(worlds),
                                       "--steps",    std::to_string(steps),
                                       "--stats",    path("stats"),
                                       "--hash-log", path("log"),
                                       "-v"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    auto program = std::make_unique<Program>(soda(arguments), directory());
    EXPECT_TRUE(program->wrote("the session starts", 60s)) << program->output();
    return program;
  }
  std::string ask(std::vector<std::string> arguments, int exit_code = 0) const {
    arguments.insert(arguments.end(), {"--session", session});
    return run(arguments, exit_code, 30s);
  }
  static void expect_says(const std::string& output, const std::string& text) {
    EXPECT_NE(output.find(text), std::string::npos) << output;
  }
  const std::string session = new_session();
};

}  // namespace soda::test
