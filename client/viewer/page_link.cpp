#include "client/viewer/page_link.h"

#include <algorithm>
#include <utility>

#include "common/version.h"

namespace soda::viewer {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;

constexpr std::uint32_t kProtocol = 3;                       // of viewer.proto
constexpr std::size_t kLargestIncoming = 256 * 1024;         // bytes
constexpr std::size_t kMostWaiting = std::size_t{64} << 20;  // bytes, beside what can be replaced
constexpr double kMessagesPerSecond = 240, kBurst = 480;
constexpr std::uint32_t kFramesUnshown = 3;
constexpr std::int64_t kFarthestLook = std::int64_t{1} << 40;  // steps

}  // namespace

PageLink::PageLink(asio::ip::tcp::socket socket, bool may_act, Handlers handlers)
    : stream_(std::move(socket)),
      may_act_(may_act),
      handlers_(std::move(handlers)),
      budget_(kBurst),
      budget_at_(Clock::now()) {
  look_.set_offset(0);
}

void PageLink::accept(const Request& request) {
  beast::get_lowest_layer(stream_).expires_never();  // the WebSocket has time limits of its own
  beast::get_lowest_layer(stream_).socket().set_option(asio::ip::tcp::no_delay(true));
  stream_.set_option(websocket::stream_base::timeout::suggested(beast::role_type::server));
  stream_.read_message_max(kLargestIncoming);
  stream_.binary(true);
  stream_.async_accept(request, [self = shared_from_this()](beast::error_code error) {
    if (error) return self->finish();
    self->open_ = true;
    self->read();
  });
}

void PageLink::read() {
  stream_.async_read(incoming_, [self = shared_from_this()](beast::error_code error, std::size_t) {
    if (error) return self->finish();
    view::FromPage message;
    const auto data = self->incoming_.data();
    const bool good = self->stream_.got_binary() && message.ParseFromArray(data.data(), static_cast<int>(data.size()));
    self->incoming_.consume(self->incoming_.size());
    if (!good)
      self->close(websocket::close_code::bad_payload, "not a message of this viewer's page");
    else if (self->too_many())
      self->close(websocket::close_code::policy_error, "too many messages");
    else
      self->take(message);
    if (self->open_) self->read();
  });
}

bool PageLink::too_many() {
  const auto now = Clock::now();
  budget_ += std::chrono::duration<double>(now - std::exchange(budget_at_, now)).count() * kMessagesPerSecond;
  budget_ = std::min(budget_, kBurst) - 1;
  return budget_ < 0;
}

void PageLink::take(const view::FromPage& message) {
  switch (message.what_case()) {
    case view::FromPage::kLook:
      look_ = message.look();
      if (look_.which_case() == view::Look::kOffset)
        look_.set_offset(std::clamp(look_.offset(), -kFarthestLook, kFarthestLook));
      break;
    case view::FromPage::kShown:
      shown_ = std::max(shown_, std::min(message.shown().number(), frames_.number()));
      break;
    case view::FromPage::kDo: {
      if (may_act_) return handlers_.wants(*this, message.do_());
      view::ToPage told;
      told.mutable_answer()->set_number(message.do_().number());
      told.mutable_answer()->set_reason(
          "this page may only watch: its link lacks the token that `soda view` has printed");
      tell(std::move(told));
      break;
    }
    default:
      break;
  }
}

void PageLink::close(websocket::close_code code, const std::string& reason) {
  if (!open_ || std::exchange(closing_, true)) return;
  stream_.async_close({code, reason.substr(0, 120)},
                      [self = shared_from_this()](beast::error_code) { self->finish(); });
}

void PageLink::finish() {
  open_ = false;
  if (auto closed = std::exchange(handlers_, {}).closed) closed(*this);
}

// ---- what it is told
// -------------------------------------------------------------------------------------------------

void PageLink::welcome(const Source& source) {
  view::ToPage message;
  *message.mutable_welcome() = source.welcome();
  message.mutable_welcome()->set_protocol(kProtocol);
  message.mutable_welcome()->set_version(kVersion);
  message.mutable_welcome()->set_may_act(may_act_);
  meshes_ = static_cast<std::uint32_t>(message.welcome().meshes_size());
  listed_ = transfers_ = 0;
  told_bodies_ = false;
  look_.set_offset(0);
  frames_.begin_another();
  forgotten_ = false;
  welcomed_ = true;
  tell(std::move(message));
  tell_bodies(source);
  tell_transfers(source);
}

void PageLink::tell_bodies(const Source& source) {
  if (!welcomed_ || (told_bodies_ && listed_ == source.listed())) return;
  told_bodies_ = true;
  view::ToPage message;
  *message.mutable_bodies() = source.bodies(listed_, meshes_);
  listed_ = source.listed();
  frames_.begin_anew();
  tell(std::move(message));
}

void PageLink::tell_transfers(const Source& source) {
  if (!welcomed_ || transfers_ == source.transfers_known()) return;
  view::ToPage message;
  *message.mutable_transfers() = source.transfers(transfers_);
  transfers_ = source.transfers_known();
  tell(std::move(message));
}

void PageLink::show(const Source& source) {
  if (!welcomed_ || writing_ || closing_ || !source.buffer() || frames_.number() >= shown_ + kFramesUnshown) return;
  const Step asked = look_.which_case() == view::Look::kStep ? look_.step() : source.displayed() + look_.offset();
  auto frame = frames_.next(source.buffer()->at(asked), *source.buffer(), listed_);
  if (!frame) return;
  view::ToPage message;
  *message.mutable_frame() = std::move(*frame);
  tell(std::move(message));
}

void PageLink::tell_ended(const End& end) {
  if (!open_ || std::exchange(ended_, true)) return;
  view::ToPage message;
  message.mutable_ended()->set_reason(end.reason);
  message.mutable_ended()->set_failed(end.failed);
  tell(std::move(message));
}

void PageLink::tell(view::ToPage message) {
  if (!open_ || closing_) return;
  queue_.push_back(message.SerializeAsString());
  queued_bytes_ += queue_.back().size();
  // A scene may be larger than that, and nothing waits before it.
  if (queued_bytes_ > kMostWaiting && (writing_ || queue_.size() > 1))
    return close(websocket::close_code::try_again_later, "the page is too slow");
  write();
}

void PageLink::tell_newest(view::ToPage message) {
  if (!open_ || closing_) return;
  (message.has_clocks() ? clocks_ : worlds_) = message.SerializeAsString();
  write();
}

void PageLink::write() {
  if (writing_ || !open_ || closing_) return;
  if (!queue_.empty()) {
    outgoing_ = std::move(queue_.front());
    queue_.pop_front();
    queued_bytes_ -= outgoing_.size();
  } else if (clocks_) {
    outgoing_ = *std::exchange(clocks_, std::nullopt);
  } else if (worlds_) {
    outgoing_ = *std::exchange(worlds_, std::nullopt);
  } else {
    return;
  }
  writing_ = true;
  stream_.async_write(asio::buffer(outgoing_), [self = shared_from_this()](beast::error_code error, std::size_t) {
    self->writing_ = false;
    if (error) return;  // the read fails, too
    self->write();
  });
}

}  // namespace soda::viewer
