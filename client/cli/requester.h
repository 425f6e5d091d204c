// Asks world 0 of a session for something, and waits for the answer.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <string>

#include "common/dds/participant.h"

namespace soda::cli {

class Requester {
 public:
  Requester(const dds::NetworkOptions& network, const std::string& session);

  // `request` without client and number. The answer; none if nobody answered in that time.
  std::optional<wire::Answer> ask(wire::Request request, std::chrono::milliseconds at_most);

 private:
  const std::uint64_t client_;
  std::uint64_t number_ = 0;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<wire::Answer> answer_;
  dds::Participant participant_;
  std::optional<dds::Reader<wire::Answer>> answers_;
  std::optional<dds::Writer<wire::Request>> requests_;
};

}  // namespace soda::cli
