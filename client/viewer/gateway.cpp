#include "client/viewer/gateway.h"

#include <boost/asio/post.hpp>
#include <utility>

namespace soda::viewer {
namespace {

using namespace std::chrono_literals;

constexpr auto kTick = 8ms;  // twice per picture of a screen
constexpr auto kClocksEvery = 50ms;
constexpr auto kWorldsEvery = 500ms;
constexpr std::size_t kMostPages = 64;

}  // namespace

Gateway::Gateway(const HttpOptions& options, const StaticFiles& files) : timer_(io_) {
  PageLink::Handlers handlers;
  handlers.wants = [this](PageLink& page, const view::Do& wanted) { wants(page, wanted); };
  handlers.closed = [this](PageLink& page) {
    for (const std::uint64_t grab : page.grabs) release(grab);
    pages_.erase(&page);
  };
  server_ = std::make_unique<HttpServer>(
      io_, options, files, std::move(handlers), [this] { return pages_.size() < kMostPages; },
      [this](std::shared_ptr<PageLink> page) { add(std::move(page)); });
}

void Gateway::add(std::shared_ptr<PageLink> page) {
  PageLink* const key = page.get();
  pages_.emplace(key, std::move(page));
}

void Gateway::wake() {
  if (woken_.exchange(true)) return;
  boost::asio::post(io_, [this] {
    woken_.store(false);
    if (source_) look();
  });
}

void Gateway::run(Source& source, const std::function<bool()>& stop) {
  source_ = &source;
  stop_ = stop;
  asked_.clear();
  for (const auto& [key, page] : pages_) {
    page->forget();
    page->grabs.clear();
  }
  io_.restart();
  tick();
  io_.run();
  source_ = nullptr;
}

void Gateway::tick() {
  look();
  if (stop_()) return io_.stop();
  timer_.expires_after(kTick);
  timer_.async_wait([this](boost::system::error_code error) {
    if (!error) tick();
  });
}

void Gateway::tell_all(const view::ToPage& message) {
  for (const auto& [key, page] : pages_)
    if (page->welcomed()) page->tell(message);
}

void Gateway::look() {
  News news = source_->poll();
  const auto now = Clock::now();
  for (auto& [tag, answer] : news.answers) {
    const auto asked = asked_.extract(tag);
    if (asked.empty()) continue;
    const auto page = asked.mapped().page.lock();
    const bool grabbed = asked.mapped().grab && answer.accepted();
    if (!page || !pages_.contains(page.get())) {
      if (grabbed) release(answer.logged());
      continue;
    }
    if (grabbed) page->grabs.insert(answer.logged());
    view::ToPage message;
    *message.mutable_answer() = std::move(answer);
    message.mutable_answer()->set_number(asked.mapped().number);
    page->tell(std::move(message));
  }
  for (const view::Rollback& rollback : news.rollbacks) {
    view::ToPage message;
    *message.mutable_rollback() = rollback;
    tell_all(message);
  }
  if (!news.events.empty()) {
    view::ToPage message;
    for (std::string& text : news.events) message.mutable_events()->add_text(std::move(text));
    tell_all(message);
  }
  const auto pages = pages_;  // a page may go away meanwhile
  for (const auto& [key, page] : pages) {
    if (!page->is_open()) continue;
    if (!page->welcomed() && source_->ready()) page->welcome(*source_);
    page->tell_bodies(*source_);
    page->tell_transfers(*source_);
    page->show(*source_);
  }
  if (now - clocks_at_ >= kClocksEvery) {
    clocks_at_ = now;
    view::ToPage message;
    *message.mutable_clocks() = source_->clocks();
    for (const auto& [key, page] : pages)
      if (page->is_open() && !page->forgotten()) page->tell_newest(message);
  }
  if (now - worlds_at_ >= kWorldsEvery && source_->ready()) {
    worlds_at_ = now;
    view::ToPage message;
    *message.mutable_worlds() = source_->worlds();
    for (const auto& [key, page] : pages)
      if (page->welcomed()) page->tell_newest(message);
  }
  if (const auto end = source_->ended())
    for (const auto& [key, page] : pages) page->tell_ended(*end);
}

void Gateway::release(std::uint64_t grab) {
  if (!source_ || !source_->ready()) return;
  view::Do wanted;
  wanted.mutable_action()->mutable_release()->set_grab(grab);
  (void)source_->ask(wanted);
}

void Gateway::wants(PageLink& page, const view::Do& wanted) {
  if (wanted.action().has_release()) page.grabs.erase(wanted.action().release().grab());
  const std::uint64_t tag = source_->ready() ? source_->ask(wanted) : 0;
  if (tag != 0) {
    asked_[tag] = {page.weak_from_this(), wanted.number(), wanted.action().has_grab()};
    return;
  }
  view::ToPage message;
  message.mutable_answer()->set_number(wanted.number());
  message.mutable_answer()->set_reason(source_->ready() ? "there is no such thing to do here"
                                                        : "the session has not begun");
  page.tell(std::move(message));
}

}  // namespace soda::viewer
