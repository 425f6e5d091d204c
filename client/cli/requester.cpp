#include "client/cli/requester.h"

#include <algorithm>
#include <random>
#include <utility>

namespace soda::cli {
namespace {

constexpr std::chrono::milliseconds kAgain{1000};

std::uint64_t random_client() {
  std::random_device device;
  return (std::uint64_t{device()} << 32 | device()) | 1;
}

}  // namespace

Requester::Requester(const dds::NetworkOptions& network, const std::string& session)
    : client_(random_client()), participant_(network, session, "soda") {
  answers_.emplace(participant_, dds::answer_topic(), [this](wire::Answer&& answer, const dds::WriterKey&) {
    if (answer.client() != client_) return;
    {
      const std::lock_guard lock(mutex_);
      answer_ = std::move(answer);
    }
    changed_.notify_one();
  });
  requests_.emplace(participant_, dds::request_topic());
}

std::optional<wire::Answer> Requester::ask(wire::Request request, std::chrono::milliseconds at_most) {
  request.client(client_);
  request.number(++number_);
  std::unique_lock lock(mutex_);
  answer_.reset();
  const auto until = std::chrono::steady_clock::now() + at_most;
  // Again and again: it is done once, however often it arrives.
  while (!answer_ && std::chrono::steady_clock::now() < until) {
    lock.unlock();
    (void)requests_->write(request);
    lock.lock();
    changed_.wait_for(lock, std::min(kAgain, at_most), [&] { return answer_ && answer_->number() == number_; });
  }
  return std::exchange(answer_, std::nullopt);
}

}  // namespace soda::cli
