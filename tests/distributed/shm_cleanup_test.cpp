#include "common/dds/shm_cleanup.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <string>

namespace soda::dds {
namespace {

TEST(ShmCleanup, RemovesWhatNobodyHoldsAndNothingElse) {
  std::string name = (std::filesystem::temp_directory_path() / "soda-shm-XXXXXX").string();
  ASSERT_NE(mkdtemp(name.data()), nullptr);
  const std::filesystem::path directory = name;
  const auto make = [&](const std::string& file) { std::ofstream(directory / file) << "x"; };
  const auto exists = [&](const std::string& file) { return std::filesystem::exists(directory / file); };
  const std::string dead = "fastrtps_0123456789abcdef", alive = "fastrtps_fedcba9876543210";
  for (const std::string& segment : {dead, alive}) make(segment), make(segment + "_el");
  for (const char* const other : {"fastrtps_port7410", "fastrtps_port7410_el", "somebody_el"}) make(other);
  const int fd = ::open((directory / (alive + "_el")).c_str(), O_RDONLY | O_CLOEXEC);
  ASSERT_EQ(::flock(fd, LOCK_EX | LOCK_NB), 0);

  EXPECT_EQ(remove_stale_segments(directory), 0u) << "too young";
  EXPECT_EQ(remove_stale_segments(directory, std::chrono::seconds(0)), 1u);
  EXPECT_FALSE(exists(dead));
  EXPECT_FALSE(exists(dead + "_el"));
  for (const std::string& kept : {alive, alive + "_el", std::string("fastrtps_port7410"),
                                  std::string("fastrtps_port7410_el"), std::string("somebody_el")})
    EXPECT_TRUE(exists(kept)) << kept;
  ::close(fd);
  std::filesystem::remove_all(directory);
}

}  // namespace
}  // namespace soda::dds
