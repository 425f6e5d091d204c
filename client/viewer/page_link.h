// One page: a WebSocket connection, what it wants to see, and what it has been told. Sends no faster than the page
// takes: at most one write is under way, at most a few frames are not yet shown, and what waits is replaced by what is
// newer.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "client/viewer/frame_maker.h"
#include "client/viewer/source.h"

namespace soda::viewer {

class PageLink : public std::enable_shared_from_this<PageLink> {
 public:
  using Request = boost::beast::http::request<boost::beast::http::empty_body>;
  struct Handlers {
    std::function<void(PageLink&, const view::Do&)> wants;  // something to be done, by a page that may
    std::function<void(PageLink&)> closed;                  // once; nothing is called afterwards
  };

  PageLink(boost::asio::ip::tcp::socket socket, bool may_act, Handlers handlers);
  void accept(const Request& request);
  void close(boost::beast::websocket::close_code code, const std::string& reason);

  bool may_act() const { return may_act_; }
  // Numbers of the grabs that it has not released: what it drags.
  std::set<std::uint64_t> grabs;
  bool is_open() const { return open_; }
  bool welcomed() const { return welcomed_; }
  // Tells the scene. Before that, nothing else should be told. Once more when another source is to be shown.
  void welcome(const Source& source);
  void forget() {  // its source is gone
    forgotten_ = forgotten_ || welcomed_;
    welcomed_ = ended_ = false;
  }
  bool forgotten() const { return forgotten_; }  // shows a source that is gone, until the next welcome
  void tell_bodies(const Source& source);        // those that it has not been told
  void tell_transfers(const Source& source);     // likewise
  void show(const Source& source);               // a frame, if there is something new and the page is ready for it
  void tell_ended(const End& end);               // once
  void tell(view::ToPage message);               // surely, in order
  void tell_newest(view::ToPage message);        // in place of one of its kind that waits

 private:
  using Clock = std::chrono::steady_clock;
  void read();
  void take(const view::FromPage& message);
  bool too_many();
  void write();
  void finish();

  boost::beast::websocket::stream<boost::beast::tcp_stream> stream_;
  const bool may_act_;
  Handlers handlers_;
  boost::beast::flat_buffer incoming_;
  bool open_ = false, welcomed_ = false, told_bodies_ = false, forgotten_ = false, writing_ = false, closing_ = false,
       ended_ = false;
  std::string outgoing_;  // being written
  std::deque<std::string> queue_;
  std::size_t queued_bytes_ = 0;
  std::optional<std::string> clocks_, worlds_;
  FrameMaker frames_;
  std::uint32_t shown_ = 0;  // newest frame that the page has taken
  std::uint32_t listed_ = 0, meshes_ = 0, transfers_ = 0;
  view::Look look_;
  double budget_;  // messages that it may send now
  Clock::time_point budget_at_;
};

}  // namespace soda::viewer
