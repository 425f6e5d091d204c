#include "tests/distributed/session.h"

#include <google/protobuf/text_format.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <random>
#include <sstream>

#include "common/actions/action_proto.h"
#include "common/scene/generators.h"
#include "common/scene/scene_file.h"
#include "tests/support/random_actions.h"

namespace soda::test {

SessionTest::SessionTest() {
  std::string name = (std::filesystem::temp_directory_path() / "soda-test-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("cannot make a directory for the test");
  directory_ = name;
}

SessionTest::~SessionTest() {
  std::error_code error;
  if (!HasFailure()) std::filesystem::remove_all(directory_, error);
}

std::string SessionTest::new_session() {
  std::random_device device;
  return "test-" + std::to_string(getpid()) + "-" + std::to_string(device());
}

std::string SessionTest::scene(const std::string& generator, std::uint32_t bodies, double cell) const {
  const std::string file = path(generator + ".scene");
  if (std::filesystem::exists(file)) return file;
  Scene scene = generate(generator, bodies, 1);
  scene.territory_cell = cell;
  save_scene(scene, file);
  return file;
}

std::string SessionTest::actions(const std::string& scene_file, Step steps, std::size_t count,
                                 std::uint64_t seed) const {
  pb::ActionFile file;
  for (const LoggedAction& entry : random_actions(load_scene(scene_file), steps, count, false, seed))
    *file.add_action() = to_proto(entry);
  std::string text;
  google::protobuf::TextFormat::PrintToString(file, &text);
  std::ofstream(path("actions.txtpb")) << text;
  return path("actions.txtpb");
}

namespace {
std::vector<std::string> with_program(const char* name, const std::vector<std::string>& arguments) {
  std::vector<std::string> words{std::string(SODA_BIN) + "/" + name};
  words.insert(words.end(), arguments.begin(), arguments.end());
  return words;
}
}  // namespace

std::vector<std::string> SessionTest::soda(const std::vector<std::string>& arguments) {
  return with_program("soda", arguments);
}
std::vector<std::string> SessionTest::soda_world(const std::vector<std::string>& arguments) {
  return with_program("soda-world", arguments);
}

void SessionTest::expect_exit(Program& program, int exit_code, std::chrono::milliseconds at_most) {
  const auto code = program.wait(at_most);
  if (!code)
    ADD_FAILURE() << "still running after " << at_most.count() << " ms:\n" << program.output();
  else
    EXPECT_EQ(*code, exit_code) << program.output();
}

std::string SessionTest::run(const std::vector<std::string>& arguments, int exit_code,
                             std::chrono::milliseconds at_most) const {
  Program program(soda(arguments), directory_);
  expect_exit(program, exit_code, at_most);
  return program.output();
}

void SessionTest::expect_equal_logs(const std::string& a, const std::string& b) const {
  const auto in_a = lines_of(a), in_b = lines_of(b);
  ASSERT_EQ(in_a.size(), in_b.size()) << a << " and " << b;
  for (std::size_t i = 0; i < in_a.size(); ++i) ASSERT_EQ(in_a[i], in_b[i]) << a << " and " << b;
}

std::string read_text(const std::string& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

std::vector<std::string> lines_of(const std::string& path) {
  std::ifstream file(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

double stat(const std::string& stats_path, const std::string& key, const std::string& section) {
  const std::string text = read_text(stats_path);
  const std::size_t from = section.empty() ? 0 : text.find('"' + section + '"');
  const std::string quoted = '"' + key + "\": ";
  const std::size_t at = from == std::string::npos ? from : text.find(quoted, from);
  if (at == std::string::npos) {
    ADD_FAILURE() << stats_path << " has no " << section << "." << key;
    return -1;
  }
  return std::strtod(text.c_str() + at + quoted.size(), nullptr);
}

}  // namespace soda::test
