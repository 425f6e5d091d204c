// Reports over DDS.
#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "client/cli/report_source.h"
#include "common/dds/participant.h"

namespace soda::cli {

class DdsSource final : public ReportSource {
 public:
  // `with_states`: also the whole states of the steps that the session dumps. `for_recording`: also poses, the action
  // log and Control.
  DdsSource(const dds::NetworkOptions& network, const std::string& session, bool with_states,
            bool for_recording = false);

  std::optional<dds::Report> next(std::chrono::milliseconds at_most) override;

 private:
  template <class T>
  void hear(const dds::Topic& topic);
  void push(dds::Report report);

  dds::Participant participant_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<dds::Report> queue_;
  std::vector<std::shared_ptr<void>> readers_;  // of all kinds; they push, and nobody asks them anything
};

}  // namespace soda::cli
