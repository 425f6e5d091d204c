// Serves the page's files, and turns requests for /ws into pages' connections.
#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "client/viewer/page_link.h"
#include "client/viewer/static_files.h"

namespace soda::viewer {

struct HttpOptions {
  std::string address = "127.0.0.1";  // to listen at
  std::uint16_t port = 8080;          // 0: any that is free
  std::string token;                  // who has it may act
  bool open_to_all = false;           // everybody may
};

class HttpLink;

class HttpServer {
 public:
  using NewPage = std::function<void(std::shared_ptr<PageLink> page)>;  // before it is open
  using HasRoom = std::function<bool()>;                                // for another page
  // Listens at once. All calls come from `io`. Throws std::runtime_error where it cannot listen there.
  HttpServer(boost::asio::io_context& io, const HttpOptions& options, const StaticFiles& files,
             PageLink::Handlers handlers, HasRoom has_room, NewPage on_page);

  std::uint16_t port() const { return acceptor_.local_endpoint().port(); }

 private:
  friend class HttpLink;
  void accept();

  const HttpOptions options_;
  const StaticFiles& files_;
  const PageLink::Handlers handlers_;
  const HasRoom has_room_;
  const NewPage on_page_;
  bool local_ = true;  // listens to this machine only
  int links_ = 0;      // connections that are not pages' yet
  boost::asio::ip::tcp::acceptor acceptor_;
  boost::asio::steady_timer again_;
};

// Whether a request comes from a page of this server, as far as its browser says: the host of Origin is that of Host.
bool same_origin(const PageLink::Request& request);
// Whether Host is a name that this machine alone has. A page of elsewhere whose name was made to lead here has its own.
bool host_is_loopback(const PageLink::Request& request);
// The value of `name` in the query of a request's target, or "".
std::string query_value(const std::string& target, const std::string& name);

}  // namespace soda::viewer
