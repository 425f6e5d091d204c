#include "tests/support/page.h"

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <cstring>

namespace soda::test {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using asio::ip::tcp;

struct Page::Impl {
  asio::io_context io;
  websocket::stream<beast::tcp_stream> stream{io};
  beast::flat_buffer incoming;
};

Page::Page(std::uint16_t port, const std::string& target, const std::string& origin) : impl_(std::make_unique<Impl>()) {
  beast::get_lowest_layer(impl_->stream).connect(tcp::endpoint(asio::ip::make_address("127.0.0.1"), port));
  impl_->stream.binary(true);
  impl_->stream.read_message_max(std::size_t{256} << 20);
  if (!origin.empty())
    impl_->stream.set_option(websocket::stream_base::decorator(
        [origin](websocket::request_type& request) { request.set(http::field::origin, origin); }));
  beast::error_code error;
  impl_->stream.handshake("127.0.0.1:" + std::to_string(port), target, error);
  if (error) {
    refusal_ = error.message();
    closed = true;
    return;
  }
  read();
}

Page::~Page() = default;

void Page::read() {
  impl_->stream.async_read(impl_->incoming, [this](beast::error_code error, std::size_t length) {
    if (error) {
      closed = true;
      close_reason = impl_->stream.reason().reason.c_str();
      return;
    }
    bytes += length;
    view::ToPage message;
    if (message.ParseFromArray(impl_->incoming.data().data(), static_cast<int>(length))) take(message);
    impl_->incoming.consume(length);
    read();
  });
}

bool Page::until(const std::function<bool()>& done, std::chrono::milliseconds at_most) {
  const auto end = std::chrono::steady_clock::now() + at_most;
  while (!done()) {
    if (closed || std::chrono::steady_clock::now() > end) return false;
    impl_->io.restart();
    impl_->io.run_one_for(std::chrono::milliseconds(20));
  }
  return true;
}

void Page::send(const view::FromPage& message) { send_raw(message.SerializeAsString()); }

void Page::send_raw(const std::string& raw, bool binary) {
  beast::error_code error;  // what matters is whether it is closed, which until() sees
  impl_->stream.binary(binary);
  impl_->stream.write(asio::buffer(raw), error);
}

std::uint32_t Page::act(view::Do what) {
  view::FromPage message;
  what.set_number(++number_);
  *message.mutable_do_() = std::move(what);
  send(message);
  return number_;
}

void Page::look(std::int64_t offset) {
  view::FromPage message;
  message.mutable_look()->set_offset(offset);
  send(message);
}

void Page::take(const view::ToPage& message) {
  switch (message.what_case()) {
    case view::ToPage::kWelcome:
      welcome = message.welcome();
      welcomed = true;
      ended.clear();
      ids.clear();
      bodies.clear();
      transfers.clear();
      break;
    case view::ToPage::kBodies:
      ids.resize(message.bodies().first());
      ids.insert(ids.end(), message.bodies().id().begin(), message.bodies().id().end());
      for (int i = 0; i < message.bodies().id_size(); ++i) mass[message.bodies().id(i)] = message.bodies().mass(i);
      break;
    case view::ToPage::kTransfers:
      transfers.insert(transfers.end(), message.transfers().transfer().begin(), message.transfers().transfer().end());
      break;
    case view::ToPage::kFrame:
      take(message.frame());
      break;
    case view::ToPage::kClocks:
      clocks = message.clocks();
      break;
    case view::ToPage::kWorlds:
      worlds = message.worlds();
      break;
    case view::ToPage::kRollback:
      rollbacks.push_back(message.rollback());
      break;
    case view::ToPage::kAnswer:
      answers.push_back(message.answer());
      break;
    case view::ToPage::kEnded:
      ended = message.ended().reason();
      failed = message.ended().failed();
      break;
    case view::ToPage::kEvents:
      events.insert(events.end(), message.events().text().begin(), message.events().text().end());
      break;
    default:
      break;
  }
}

void Page::take(const view::Frame& told) {
  ++frames;
  if (told.whole()) {
    bodies.clear();
    ++wholes;
  }
  const auto index_at = [](const std::string& bytes_of, std::size_t i) {
    std::uint32_t index = 0;
    std::memcpy(&index, bytes_of.data() + 4 * i, 4);
    return index;
  };
  for (std::size_t i = 0; i < told.index().size() / 4; ++i) {
    Body body;
    std::memcpy(body.position.data(), told.position().data() + 12 * i, 12);
    std::uint16_t world = 0;
    std::memcpy(&world, told.world().data() + 2 * i, 2);
    body.world = world;
    body.flags = static_cast<unsigned char>(told.flags()[i]);
    redone += (body.flags & view::FLAG_REDONE) != 0;
    bodies[ids.at(index_at(told.index(), i))] = body;
  }
  for (std::size_t i = 0; i < told.gone().size() / 4; ++i) bodies.erase(ids.at(index_at(told.gone(), i)));
  frame = told;
  if (!acknowledges) return;
  view::FromPage shown;
  shown.mutable_shown()->set_number(told.number());
  send(shown);
}

std::pair<int, std::string> get(std::uint16_t port, const std::string& target, const std::string& host) {
  asio::io_context io;
  beast::tcp_stream stream(io);
  stream.connect(tcp::endpoint(asio::ip::make_address("127.0.0.1"), port));
  http::request<http::empty_body> request(http::verb::get, target, 11);
  request.set(http::field::host, host);
  http::write(stream, request);
  beast::flat_buffer buffer;
  http::response<http::string_body> response;
  http::read(stream, buffer, response);
  return {static_cast<int>(response.result_int()), response.body()};
}

}  // namespace soda::test
