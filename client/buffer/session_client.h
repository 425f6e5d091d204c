// A session as whoever watches sees it: joins at any time, describes it, follows all worlds' buffers, and asks for
// things. No part of the simulation: however slow it is, no world waits for it.
//
// DDS speaks in threads of its own; what came is kept until poll(), and everything else is for one thread. Like this:
//
//   SessionClient client({}, "demo");
//   while (...) {
//     client.poll(100ms);
//     if (client.buffer()) show(client.buffer()->at(client.displayed()));
//   }
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "client/buffer/transform_buffer.h"
#include "common/dds/participant.h"
#include "common/scene/scene.h"

namespace soda::buffer {

// How a session is followed.
struct Following {
  Step history = 120;  // steps before the displayed one that are kept
  // Called from threads of DDS whenever something has come: to wake whoever will call poll().
  std::function<void()> on_news = {};
  // Otherwise the buffer stays empty, and the worlds need not tell of bodies; nor are transfers heard.
  bool transforms = true;
  // Only a session that has begun after this one (wire::Session::started): to follow the next one of a name.
  std::int64_t after = 0;
};

class SessionClient {
 public:
  using Clock = std::chrono::steady_clock;
  struct World {
    std::optional<wire::Status> status;  // the newest
    Clock::time_point heard{};           // when that came
    bool silent(Clock::time_point now) const { return !status || now - heard > dds::kSilence; }
  };

  // Throws as dds::Participant.
  SessionClient(const dds::NetworkOptions& network, const std::string& session, Following following = {});
  ~SessionClient();

  // Takes what has come, waiting for it as long as that if nothing has.
  void poll(std::chrono::milliseconds at_most);

  // Nothing until heard of.
  const std::optional<wire::Session>& session() const { return session_; }
  const std::optional<wire::Control>& control() const { return control_; }
  std::shared_ptr<const Scene> scene() const { return scene_; }  // as it was at the start
  const std::vector<World>& worlds() const { return worlds_; }
  const TransformBuffer* buffer() const { return buffer_ ? &*buffer_ : nullptr; }
  Step displayed() const { return control_ ? control_->displayed() : 0; }
  // The session's world 0 speaks another version of the protocol: nothing else will be heard. 0: it does not.
  std::uint32_t other_protocol() const { return other_protocol_; }
  // Why nothing more will come, or "": the session has ended, or failed; another one of its name has begun.
  const std::string& ended() const { return ended_; }
  bool failed() const { return failed_; }  // it has not ended as it should
  // Another session of its name has begun after it, or this one is heard of again after all. A client that is made with
  // Following::after as next() says follows that.
  bool superseded() const { return superseded_; }
  std::int64_t next() const { return session_ ? session_->started() - (gone_ ? 1 : 0) : following_.after; }

  // Bodies that were spawned so far, in the order in which that was heard.
  struct Spawned {
    BodyId id = 0;
    std::shared_ptr<const Scene> shape;  // a scene of that body alone
  };
  const std::vector<Spawned>& spawned() const { return spawned_; }

  // Cells that change hands, each transfer once, in the order in which they were heard: not that of their steps.
  // Worlds, but not cells, are those of the session.
  const std::vector<wire::Transfer>& transfers() const { return transfers_; }

  // Asks world 0; `request` without client and number. Returns the number that the answer will have.
  std::uint64_t ask(wire::Request request);
  // Answers that have come since the last call. Requests without an answer are told again; after ten seconds the answer
  // is a refusal made here.
  std::vector<wire::Answer> take_answers();

 private:
  struct Told {  // by one of the session's participants
    wire::Transforms sample;
    dds::WriterKey writer;
  };
  using News = std::variant<wire::Session, wire::SceneChunk, wire::Control, wire::Status, wire::LogEntry, wire::Answer,
                            wire::Transfer, Told>;
  template <class T>
  void hear(const dds::Topic& topic);
  void keep(Told&& told);  // with mutex_ held
  void take(wire::Session&& sample);
  void take(wire::SceneChunk&& sample);
  void take(wire::Control&& sample);
  void take(wire::Status&& sample);
  void take(wire::LogEntry&& sample);
  void take(wire::Answer&& sample);
  void take(wire::Transfer&& sample);
  void take(Told&& told);
  template <class T>
  bool mine(const T& sample);
  void assemble_scene();
  void fail(std::string why);
  void write_requests();
  void ask_again(Clock::time_point now);
  void tell_lacks(Clock::time_point now);

  struct Asked {
    wire::Request request;
    Clock::time_point first, last;
  };

  const std::uint64_t client_;
  const Following following_;
  std::mutex mutex_;  // guards the next four
  std::condition_variable changed_;
  std::deque<News> queue_;
  std::size_t queued_bytes_ = 0;  // of transforms
  bool dropped_ = false;          // some of them were more than could be kept

  std::optional<wire::Session> session_;
  std::optional<wire::Control> control_;
  std::vector<std::string> chunks_;
  std::shared_ptr<const Scene> scene_;
  std::vector<World> worlds_;
  std::optional<TransformBuffer> buffer_;
  std::map<WorldId, Clock::time_point> lacking_;  // worlds whose samples were missed: when that was told
  struct Teller {
    dds::WriterKey writer{};
    Clock::time_point heard{};
  };
  std::vector<Teller> tellers_;  // by world: who tells of it; nobody else is believed
  std::vector<Spawned> spawned_;
  std::set<std::uint64_t> logged_;    // entries of the action log that were heard
  std::deque<wire::LogEntry> early_;  // of them, those heard before the scene
  std::vector<wire::Transfer> transfers_;
  std::set<std::pair<WorldId, std::uint32_t>> known_transfers_;  // giver, number
  std::deque<wire::Transfer> early_transfers_;                   // heard before the session was known
  std::uint32_t other_protocol_ = 0;
  std::string ended_;
  bool failed_ = false, superseded_ = false;
  bool gone_ = false;   // nothing was heard of it for long, and it was given up
  bool rival_ = false;  // a later session of this name has been heard of
  std::uint64_t number_ = 0, written_ = 0;
  std::map<std::uint64_t, Asked> asked_;
  std::vector<wire::Answer> answers_;

  dds::Participant participant_;
  dds::Writer<wire::Request> requests_;
  dds::Writer<wire::Lack> lacks_;
  std::vector<std::shared_ptr<void>> readers_;  // destroyed first: their handlers use all the rest
};

}  // namespace soda::buffer
