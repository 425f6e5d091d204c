// Dumps, pace and lists of steps: what is written is read, and what is broken is refused.
#include "common/dump.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <sstream>
#include <string>

#include "common/run_settings.h"

namespace soda {
namespace {

class Dump : public ::testing::Test {
 protected:
  Dump() : path_(std::filesystem::temp_directory_path() / ("soda-dump-" + std::to_string(getpid()))) {}
  ~Dump() override { std::filesystem::remove(path_); }

  static BodySet state(double x) {
    BodySet set;
    for (BodyId id : {3u, 7u}) {
      BodyState body;
      body.id = id;
      body.position[0] = x + static_cast<double>(id);
      set.bodies.push_back(body);
    }
    ContactRecord record;
    record.a = 3, record.b = 7, record.count = 1;
    set.contacts.push_back(record);
    return set;
  }
  void write() const {
    DumpWriter writer(path_, {0xabcdef, 5, 6});
    writer.add(5, state(0.1));
    writer.add(6, state(0.2));
    writer.close();
  }
  std::string bytes() const {
    std::ifstream file(path_, std::ios::binary);
    std::stringstream text;
    text << file.rdbuf();
    return text.str();
  }
  void put(const std::string& bytes) const { std::ofstream(path_, std::ios::binary | std::ios::trunc) << bytes; }
  void read_all() const {
    DumpReader reader(path_);
    while (reader.next()) {
    }
  }

  const std::filesystem::path path_;
};

TEST_F(Dump, ComesBack) {
  write();
  EXPECT_TRUE(is_dump(path_));
  DumpReader reader(path_);
  EXPECT_EQ(reader.header().scene_hash, 0xabcdefu);
  EXPECT_EQ(reader.header().first, 5);
  EXPECT_EQ(reader.header().last, 6);
  const auto first = reader.next(), second = reader.next();
  ASSERT_TRUE(first && second);
  EXPECT_FALSE(reader.next());
  EXPECT_EQ(first->step, 5);
  EXPECT_EQ(second->state.bodies.size(), 2u);
  EXPECT_EQ(second->state.bodies[1].position[0], 0.2 + 7);
  EXPECT_EQ(second->state.contacts.at(0).b, 7u);
}

TEST_F(Dump, TruncatedAnywhereIsRefused) {
  write();
  const std::string whole = bytes();
  EXPECT_NO_THROW(read_all());
  const std::size_t first_step = 48, second_step = 48 + 32 + 2 * sizeof(BodyState) + sizeof(ContactRecord);
  for (std::size_t length = 0; length < whole.size(); ++length) {
    put(whole.substr(0, length));
    if (length == first_step || length == second_step) continue;  // between steps: a run that was ended early
    EXPECT_THROW(read_all(), DumpError) << length;
  }
}

TEST_F(Dump, DamagedIsRefused) {
  write();
  std::string damaged = bytes();
  damaged[100] = static_cast<char>(damaged[100] ^ 4);
  put(damaged);
  EXPECT_THROW(read_all(), DumpError);
}

TEST_F(Dump, ImpossibleCountsAreRefusedBeforeMemoryIsTaken) {
  write();
  std::string huge = bytes();
  for (std::size_t i = 56; i < 72; ++i) huge[i] = '\x7f';
  put(huge);
  EXPECT_THROW(read_all(), DumpError);
}

TEST(RunSettings, Words) {
  EXPECT_EQ(parse_pace("realtime"), 1);
  EXPECT_EQ(parse_pace("max"), 0);
  EXPECT_EQ(parse_pace("2.5"), 2.5);
  for (const char* const bad : {"", "0", "-1", "nan", "inf", "1x", "1e9"})
    EXPECT_THROW(parse_pace(bad), std::invalid_argument) << bad;
  EXPECT_EQ(parse_steps("7"), (std::pair<Step, Step>(7, 7)));
  EXPECT_EQ(parse_steps("7:9"), (std::pair<Step, Step>(7, 9)));
  for (const char* const bad : {"", ":", "9:7", "-1", "1:2:3", "a"})
    EXPECT_THROW(parse_steps(bad), std::invalid_argument) << bad;
  EXPECT_EQ(parse_worlds("none"), std::vector<WorldId>());
  EXPECT_EQ(parse_worlds("3,0-1,1"), (std::vector<WorldId>{0, 1, 3}));
  for (const char* const bad : {"", ",", "1,", "2-1", "x", "0-99999"})
    EXPECT_THROW(parse_worlds(bad), std::invalid_argument) << bad;
}

}  // namespace
}  // namespace soda
