#include "common/dds/shm_cleanup.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

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
  const std::string starting = "fastrtps_00000000000000aa";  // whose lock is still to be made
  make(starting);
  make("fastrtps_port7410"), make("sem.fastrtps_port7410_mutex");  // left by its reader
  make("fastrtps_port7412"), make("fastrtps_port7412_el");         // its reader was killed
  make("fastrtps_port7414"), make("fastrtps_port7414_el"), make("sem.fastrtps_port7414_mutex");
  make("somebody_el"), make("fastrtps_portal");
  std::vector<int> held;
  for (const std::string& file : {alive, std::string("fastrtps_port7414")}) {
    held.push_back(::open((directory / (file + "_el")).c_str(), O_RDONLY | O_CLOEXEC));
    ASSERT_EQ(::flock(held.back(), LOCK_EX | LOCK_NB), 0);
  }

  EXPECT_EQ(remove_stale_shm(directory), 0u) << "too young";
  EXPECT_EQ(remove_stale_shm(directory, std::chrono::seconds(0)), 3u);
  for (const std::string& gone :
       {dead, dead + "_el", std::string("fastrtps_port7410"), std::string("sem.fastrtps_port7410_mutex"),
        std::string("fastrtps_port7412"), std::string("fastrtps_port7412_el")})
    EXPECT_FALSE(exists(gone)) << gone;
  for (const std::string& kept :
       {alive, alive + "_el", starting, std::string("fastrtps_port7414"), std::string("fastrtps_port7414_el"),
        std::string("sem.fastrtps_port7414_mutex"), std::string("somebody_el"), std::string("fastrtps_portal")})
    EXPECT_TRUE(exists(kept)) << kept;
  for (const int fd : held) ::close(fd);
  std::filesystem::remove_all(directory);
}

}  // namespace
}  // namespace soda::dds
