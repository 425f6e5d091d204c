// Other processors: glibc chooses variants of sin, atan2 and the like by CPU, with and without fused multiply-add, and
// their last bits differ. None of them may reach the state. The same runs are done in a child process in which glibc is
// told that the CPU has neither FMA nor AVX2, and every state must have the same hash.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <bit>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "common/state_hash.h"
#include "physics_scenes.h"

namespace soda::physics::test {
namespace {

constexpr const char* kOldCpu = "glibc.cpu.hwcaps=-FMA,-AVX2,-FMA4";
constexpr const char* kOutput = "SODA_TEST_HASHES";  // environment: the file that the child writes

// A line per step: scene, step, hash of the whole set.
std::string hashes_of_runs() {
  std::ostringstream out;
  for (const Case& c : cases()) {
    const Model model(c.make());
    Stepper stepper(model);
    BodySet set = model.initial_state();
    for (int t = 1; t <= c.steps; ++t) {
      stepper.step(set);
      out << c.name << ' ' << t << ' ' << std::hex << full_hash(set) << std::dec << '\n';
    }
  }
  return out.str();
}

// Of the bits of the library's results for many arguments: differs between its variants.
std::string digest_of_libm() {
  std::uint64_t digest = 0;
  for (int i = 0; i < 100000; ++i) {
    const double x = 0.1 + 0.00317 * i;
    for (const double y : {std::sin(x), std::atan2(x, 2.5), std::exp(-x)})
      digest = digest * 0x9e3779b97f4a7c15ull + std::bit_cast<std::uint64_t>(y);
  }
  return std::to_string(digest);
}

// Not a test: what the child process runs.
TEST(PhysicsHosts, DISABLED_WriteHashes) {
  const char* path = std::getenv(kOutput);
  ASSERT_NE(path, nullptr);
  std::ofstream(path) << digest_of_libm() << '\n' << hashes_of_runs();
}

TEST(PhysicsHosts, SameBitsWithoutFusedMultiplyAdd) {
  const std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("soda_hashes_" + std::to_string(getpid()) + ".txt");
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    setenv("GLIBC_TUNABLES", kOldCpu, 1);
    setenv(kOutput, path.c_str(), 1);
    const int null = open("/dev/null", O_WRONLY);
    dup2(null, STDOUT_FILENO);
    execl("/proc/self/exe", "unit_tests", "--gtest_also_run_disabled_tests",
          "--gtest_filter=PhysicsHosts.DISABLED_WriteHashes", static_cast<char*>(nullptr));
    _exit(127);
  }
  const std::string here = hashes_of_runs();
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_EQ(status, 0);
  std::ifstream file(path);
  std::string libm;
  std::getline(file, libm);
  std::ostringstream rest;
  rest << file.rdbuf();
  std::filesystem::remove(path);
  const std::string there = rest.str();

  // Where this CPU has FMA, the child must have used other variants, or this test would compare like with like.
  if (__builtin_cpu_supports("fma")) {
    EXPECT_NE(libm, digest_of_libm());
  } else {
    GTEST_SKIP() << "this CPU has no FMA to compare with";
  }
  std::istringstream expected(here), got(there);
  std::string e, g;
  while (std::getline(expected, e)) {
    ASSERT_TRUE(std::getline(got, g)) << "the child stopped before " << e;
    ASSERT_EQ(e, g);
  }
  EXPECT_GT(here.size(), 1000u);
}

}  // namespace
}  // namespace soda::physics::test
