// A page of the viewer without a browser: connects to the gateway, keeps what it is told, and answers as the page does.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "viewer.pb.h"

namespace soda::test {

class Page {
 public:
  // `target` as "/ws?token=..."; `origin`: what a browser would say of where the page is from. Whether it could connect
  // `refusal()` says.
  Page(std::uint16_t port, const std::string& target, const std::string& origin = "");
  ~Page();
  const std::string& refusal() const { return refusal_; }  // "" or what the handshake came to

  // Takes what comes until `done` says so; false when the time is up, or the connection ends, before.
  bool until(const std::function<bool()>& done, std::chrono::milliseconds at_most = std::chrono::seconds(30));
  void send(const view::FromPage& message);
  void send_raw(const std::string& bytes, bool binary = true);
  std::uint32_t act(view::Do what);  // returns its number
  void look(std::int64_t offset);

  bool acknowledges = true;  // Shown after each frame
  bool closed = false;
  std::string close_reason;
  view::Welcome welcome;
  bool welcomed = false;
  std::vector<std::uint64_t> ids;        // by index
  std::map<std::uint64_t, double> mass;  // kg, by id
  struct Body {
    std::array<float, 3> position{};
    int world = 0, flags = 0;
  };
  std::map<std::uint64_t, Body> bodies;  // those shown, by id
  view::Frame frame;                     // newest
  std::uint64_t frames = 0, wholes = 0, bytes = 0, redone = 0;
  view::Clocks clocks;
  view::Worlds worlds;
  std::vector<view::Transfer> transfers;
  std::vector<view::Answer> answers;
  std::vector<view::Rollback> rollbacks;
  std::vector<std::string> events;
  std::string ended;
  bool failed = false;

 private:
  struct Impl;
  void read();
  void take(const view::ToPage& message);
  void take(const view::Frame& told);
  std::unique_ptr<Impl> impl_;
  std::string refusal_;
  std::uint32_t number_ = 0;
};

// The answer to a GET: status, and body. `host`: what a browser would call the server.
std::pair<int, std::string> get(std::uint16_t port, const std::string& target, const std::string& host = "127.0.0.1");

}  // namespace soda::test
