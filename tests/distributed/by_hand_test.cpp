// Daemons started by hand: on one machine, with and without the command, over UDP alone, with a discovery server; and,
// where that is allowed, on two hosts, which are two network namespaces here.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <memory>
#include <thread>

#include "tests/distributed/session.h"

namespace soda::test {
namespace {

class ByHand : public SessionTest {
 protected:
  ByHand() : file_(scene("cubes", 200)) {
    run({"run", file_, "--sync", "single", "--steps", "200", "--pace", "max", "-q", "--hash-log", path("single.log")});
  }
  // World 0's options for the run of the reference.
  std::vector<std::string> host(const std::string& session, int worlds, const std::vector<std::string>& more) const {
    std::vector<std::string> words =
        soda_world({"--session", session, "--world", "0", "--worlds", std::to_string(worlds), "--scene", file_,
                    "--steps", "200", "--pace", "max", "--watched"});
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  static std::vector<std::string> guest(const std::string& session, int world, const std::vector<std::string>& more) {
    std::vector<std::string> words = soda_world({"--session", session, "--world", std::to_string(world)});
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }

  // Three daemons and a watcher, each with those options, each behind that prefix.
  void run_session(const std::vector<std::string>& options, const std::vector<std::vector<std::string>>& prefixes) {
    const std::string session = new_session();
    const auto start = [&](std::size_t i, std::vector<std::string> words) {
      const auto& prefix = prefixes[i % prefixes.size()];
      words.insert(words.begin(), prefix.begin(), prefix.end());
      return std::make_unique<Program>(words, directory());
    };
    std::vector<std::string> watch = soda({"watch", "--session", session, "--hash-log", path("watch.log"), "-q"});
    watch.insert(watch.end(), options.begin(), options.end());
    const auto watcher = start(0, watch);
    const auto second = start(1, guest(session, 1, options));
    const auto first = start(0, host(session, 3, options));
    const auto third = start(0, guest(session, 2, options));
    for (Program* program : {first.get(), second.get(), third.get()}) {
      expect_exit(*program, 0, 90s);
      EXPECT_NE(program->output().find("step 200 is final"), std::string::npos) << program->output();
    }
    expect_exit(*watcher, 0, 30s);
    expect_equal_logs(path("single.log"), path("watch.log"));
  }

  const std::string file_;
};

TEST_F(ByHand, DaemonsInAnyOrderGiveTheSameHashes) { run_session({}, {{}}); }

TEST_F(ByHand, OverUdpAlone) { run_session({"--no-shm"}, {{}}); }

TEST_F(ByHand, AllInterfaces) { run_session({"--interface", "all"}, {{}}); }

TEST_F(ByHand, SomeStartedByTheCommandSomeByHand) {
  const std::string session = new_session();
  Program command(soda({"run", file_, "--session", session, "--worlds", "4", "--start", "0,2", "--steps", "200",
                        "--pace", "max", "-q", "--hash-log", path("mixed.log")}),
                  directory());
  ASSERT_TRUE(command.wrote("start the other worlds by hand", 30s)) << command.output();
  Program one(guest(session, 1, {}), directory());
  Program three(guest(session, 3, {}), directory());
  expect_exit(command, 0, 90s);
  expect_exit(one, 0, 30s);
  expect_exit(three, 0, 30s);
  expect_equal_logs(path("single.log"), path("mixed.log"));
}

TEST_F(ByHand, DiscoveryServer) {
  if (access("/usr/bin/fast-discovery-server", X_OK) != 0) GTEST_SKIP() << "fast-discovery-server is not installed";
  const std::string port = std::to_string(20000 + getpid() % 10000);
  Program server({"/usr/bin/fast-discovery-server", "-i", "0", "-l", "127.0.0.1", "-p", port}, directory());
  std::this_thread::sleep_for(1s);
  if (!alive(server.pid())) GTEST_SKIP() << "the discovery server does not start: " << server.output();
  run_session({"--discovery-server", "127.0.0.1:" + port}, {{}});
}

// Two network namespaces joined by a cable are two hosts to DDS: other addresses, and no shared memory between them.
class TwoHosts : public ByHand {
 protected:
  void SetUp() override {
    const std::string id = std::to_string(getpid());
    a_ = "soda-a-" + id, b_ = "soda-b-" + id;
    const std::string cable_a = "sa" + id, cable_b = "sb" + id;
    made_ = sh("ip netns add " + a_) && sh("ip netns add " + b_) &&
            sh("ip link add " + cable_a + " type veth peer name " + cable_b) &&
            sh("ip link set " + cable_a + " netns " + a_) && sh("ip link set " + cable_b + " netns " + b_) &&
            sh("ip -n " + a_ + " addr add 10.99.7.1/24 dev " + cable_a) &&
            sh("ip -n " + b_ + " addr add 10.99.7.2/24 dev " + cable_b) && sh("ip -n " + a_ + " link set lo up") &&
            sh("ip -n " + b_ + " link set lo up") && sh("ip -n " + a_ + " link set " + cable_a + " up") &&
            sh("ip -n " + b_ + " link set " + cable_b + " up");
    if (!made_) GTEST_SKIP() << "network namespaces cannot be made here (needs root and iproute2)";
  }
  void TearDown() override {
    sh("ip netns del " + a_);
    sh("ip netns del " + b_);
  }
  static bool sh(const std::string& command) { return std::system((command + " >/dev/null 2>&1").c_str()) == 0; }

  std::string a_, b_;
  bool made_ = false;
};

TEST_F(TwoHosts, ACableApart) {
  run_session({"--interface", "all"}, {{"/usr/sbin/ip", "netns", "exec", a_}, {"/usr/sbin/ip", "netns", "exec", b_}});
}

}  // namespace
}  // namespace soda::test
