// The viewer's gateway: shows a source to any number of pages, and hands over what they want to be done.
#pragma once

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "client/viewer/http_server.h"
#include "client/viewer/page_link.h"
#include "client/viewer/source.h"

namespace soda::viewer {

class Gateway {
 public:
  // Listens at once. Throws std::runtime_error as HttpServer.
  Gateway(const HttpOptions& options, const StaticFiles& files);

  std::uint16_t port() const { return server_->port(); }
  // From any thread: the source has news.
  void wake();
  // Serves until `stop` says so, which is asked some times a second. Once more with another source: the pages stay.
  void run(Source& source, const std::function<bool()>& stop);

 private:
  using Clock = std::chrono::steady_clock;
  void tick();
  void look();  // takes what is new, and tells it
  void add(std::shared_ptr<PageLink> page);
  void wants(PageLink& page, const view::Do& wanted);
  void tell_all(const view::ToPage& message);

  boost::asio::io_context io_;
  boost::asio::steady_timer timer_;
  Source* source_ = nullptr;
  std::function<bool()> stop_;
  std::map<PageLink*, std::shared_ptr<PageLink>> pages_;
  struct Asked {
    std::weak_ptr<PageLink> page;
    std::uint32_t number = 0;
    bool grab = false;  // of a body
  };
  void release(std::uint64_t grab);       // that nobody holds any more
  std::map<std::uint64_t, Asked> asked_;  // by the source's tag
  std::atomic<bool> woken_{false};
  Clock::time_point clocks_at_{}, worlds_at_{};
  std::unique_ptr<HttpServer> server_;  // last: its handlers use the rest
};

}  // namespace soda::viewer
