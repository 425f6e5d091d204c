#include "client/viewer/http_server.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <stdexcept>
#include <utility>

namespace soda::viewer {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;

constexpr std::chrono::seconds kPatience{30};
constexpr std::chrono::seconds kAcceptAgain{1};
constexpr int kMostLinks = 256;
constexpr std::uint32_t kLargestHeader = 16 * 1024;  // bytes

// Takes as long for any wrong token.
bool same_secret(const std::string& l, const std::string& r) {
  unsigned char difference = l.size() != r.size();
  for (std::size_t i = 0; i < std::min(l.size(), r.size()); ++i)
    difference = static_cast<unsigned char>(difference | (l[i] ^ r[i]));
  return difference == 0;
}

}  // namespace

// One connection of a browser, until it becomes a page's.
class HttpLink : public std::enable_shared_from_this<HttpLink> {
 public:
  HttpLink(tcp::socket socket, HttpServer& server) : stream_(std::move(socket)), server_(server) { ++server_.links_; }
  ~HttpLink() { --server_.links_; }
  HttpLink(const HttpLink&) = delete;
  HttpLink& operator=(const HttpLink&) = delete;

  void read() {
    parser_.emplace();
    parser_->header_limit(kLargestHeader);
    parser_->body_limit(0);
    stream_.expires_after(kPatience);
    http::async_read(stream_, buffer_, *parser_, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (!error) self->answer();
    });
  }

 private:
  void answer() {
    const PageLink::Request request = parser_->release();
    const std::string target(request.target());
    const std::string path = target.substr(0, target.find('?'));
    const HttpOptions& options = server_.options_;
    if (server_.local_ && !host_is_loopback(request))
      return send(request, http::status::forbidden, "this viewer is for this machine alone\n");
    if (beast::websocket::is_upgrade(request)) {
      if (path != "/ws") return send(request, http::status::not_found, "there is no such thing here\n");
      if (!same_origin(request)) return send(request, http::status::forbidden, "pages of others may not connect\n");
      if (!server_.has_room_())
        return send(request, http::status::service_unavailable, "too many pages watch already\n");
      const bool has_token = !options.token.empty() && same_secret(query_value(target, "token"), options.token);
      const bool may_act = options.open_to_all || has_token;
      const auto page = std::make_shared<PageLink>(stream_.release_socket(), may_act, server_.handlers_);
      server_.on_page_(page);
      return page->accept(request);
    }
    if (request.method() != http::verb::get && request.method() != http::verb::head)
      return send(request, http::status::method_not_allowed, "only GET and HEAD\n");
    if (const StaticFile* file = server_.files_.find(path))
      return send(request, http::status::ok, file->bytes, file->type);
    send(request, http::status::not_found, "there is no such thing here\n");
  }

  void send(const PageLink::Request& request, http::status status, const std::string& text,
            const std::string& type = "text/plain; charset=utf-8") {
    auto response = std::make_shared<http::response<http::string_body>>(status, request.version());
    response->set(http::field::server, "soda");
    response->set(http::field::content_type, type);
    response->set(http::field::cache_control, "no-cache");
    response->set("X-Content-Type-Options", "nosniff");
    response->set("Referrer-Policy", "no-referrer");  // the address may hold the token
    response->set("Content-Security-Policy",
                  "default-src 'self'; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; "
                  "worker-src 'self' blob:; connect-src 'self' ws: wss:; frame-ancestors 'none'");
    response->keep_alive(request.keep_alive());
    response->body() = text;
    response->prepare_payload();
    if (request.method() == http::verb::head) response->body().clear();
    http::async_write(stream_, *response, [self = shared_from_this(), response](beast::error_code error, std::size_t) {
      if (error) return;
      if (response->need_eof()) {
        beast::error_code ignored;
        self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
        return;
      }
      self->read();
    });
  }

  beast::tcp_stream stream_;
  HttpServer& server_;
  beast::flat_buffer buffer_;
  std::optional<http::request_parser<http::empty_body>> parser_;
};

bool same_origin(const PageLink::Request& request) {
  const std::string origin(request[http::field::origin]);
  if (origin.empty()) return true;  // no browser
  const std::size_t scheme = origin.find("://");
  return scheme != std::string::npos && origin.substr(scheme + 3) == request[http::field::host];
}

bool host_is_loopback(const PageLink::Request& request) {
  const std::string host(request[http::field::host]);
  if (host.empty()) return true;  // no browser
  const std::string name = host.front() == '[' ? host.substr(0, host.find(']') + 1) : host.substr(0, host.find(':'));
  boost::system::error_code error;
  const auto address = asio::ip::make_address_v4(name, error);
  return name == "localhost" || name == "[::1]" || (!error && address.is_loopback());
}

std::string query_value(const std::string& target, const std::string& name) {
  std::size_t at = target.find('?');
  while (at != std::string::npos) {
    const std::size_t end = target.find('&', ++at);
    const std::string pair = target.substr(at, end == std::string::npos ? end : end - at);
    if (pair.compare(0, name.size() + 1, name + "=") == 0) return pair.substr(name.size() + 1);
    at = end;
  }
  return "";
}

HttpServer::HttpServer(asio::io_context& io, const HttpOptions& options, const StaticFiles& files,
                       PageLink::Handlers handlers, HasRoom has_room, NewPage on_page)
    : options_(options),
      files_(files),
      handlers_(std::move(handlers)),
      has_room_(std::move(has_room)),
      on_page_(std::move(on_page)),
      acceptor_(io),
      again_(io) {
  beast::error_code error;
  const asio::ip::address address = asio::ip::make_address(options.address, error);
  if (error) throw std::runtime_error("'" + options.address + "' is not an IP address");
  local_ = address.is_loopback();
  const tcp::endpoint endpoint(address, options.port);
  acceptor_.open(endpoint.protocol());
  acceptor_.set_option(tcp::acceptor::reuse_address(true));
  acceptor_.bind(endpoint, error);
  if (!error) acceptor_.listen(asio::socket_base::max_listen_connections, error);
  if (error)
    throw std::runtime_error("cannot listen at " + options.address + " port " + std::to_string(options.port) + ": " +
                             error.message() + "; another one: --port, 0 for any that is free");
  accept();
}

void HttpServer::accept() {
  acceptor_.async_accept([this](beast::error_code error, tcp::socket socket) {
    if (error == asio::error::operation_aborted) return;
    if (!error && links_ < kMostLinks) std::make_shared<HttpLink>(std::move(socket), *this)->read();
    if (!error) return accept();
    // Too many files are open, perhaps: that does not pass at once.
    spdlog::warn("a connection could not be taken: {}", error.message());
    again_.expires_after(kAcceptAgain);
    again_.async_wait([this](beast::error_code cancelled) {
      if (!cancelled) accept();
    });
  });
}

}  // namespace soda::viewer
