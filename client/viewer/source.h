// Where the viewer's gateway has its pictures from: a session that runs, or a recording. All calls come from one
// thread.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/buffer/transform_buffer.h"
#include "viewer.pb.h"

namespace soda::viewer {

// Why nothing more will come.
struct End {
  std::string reason;
  bool failed = false;  // otherwise it has come to its end as it should
};

// What has happened since it was asked last.
struct News {
  std::vector<view::Rollback> rollbacks;
  std::vector<std::string> events;
  // Answers to ask(), by its tag.
  std::vector<std::pair<std::uint64_t, view::Answer>> answers;
};

class Source {
 public:
  virtual ~Source() = default;

  // Takes in what has come. Quick.
  virtual News poll() = 0;

  // Whether there is a scene to show; before that, only clocks() and ended() mean something.
  virtual bool ready() const = 0;
  // All but protocol, version and may_act.
  virtual view::Welcome welcome() const = 0;
  // How many bodies can be listed, and those from `first` on. Meshes are told once: the list has those from number
  // `meshes` on, which becomes how many there are.
  virtual std::uint32_t listed() const = 0;
  virtual view::BodyList bodies(std::uint32_t first, std::uint32_t& meshes) const = 0;

  // How many transfers of cells are known, and those from number `first` on, in the order in which they became known.
  virtual std::uint32_t transfers_known() const = 0;
  virtual view::Transfers transfers(std::uint32_t first) const = 0;

  virtual const buffer::TransformBuffer* buffer() const = 0;
  virtual Step displayed() const = 0;
  virtual view::Clocks clocks() const = 0;
  virtual view::Worlds worlds() = 0;             // rates are those since the last call
  virtual std::optional<End> ended() const = 0;  // nothing while more may come

  // Asks for something; the answer comes with poll(). Returns its tag.
  virtual std::uint64_t ask(const view::Do& wanted) = 0;
};

}  // namespace soda::viewer
