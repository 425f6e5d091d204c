#include "common/run_settings.h"

#include <algorithm>
#include <charconv>
#include <stdexcept>
#include <string_view>
#include <system_error>

namespace soda {
namespace {

template <class T>
T number(std::string_view text, const std::string& whole, const char* what) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size())
    throw std::invalid_argument(std::string(what) + ", not '" + whole + "'");
  return value;
}

}  // namespace

const std::vector<std::string>& sync_names() {
  static const std::vector<std::string> names{"single", "conservative", "anticipative"};
  return names;
}

const std::string& sync_name(unsigned char mode) {
  static const std::string unknown = "unknown";
  return mode < sync_names().size() ? sync_names()[mode] : unknown;
}

SyncMode parse_sync(const std::string& name) {
  const auto at = std::find(sync_names().begin(), sync_names().end(), name);
  if (at == sync_names().end())
    throw std::invalid_argument("a way to synchronise is 'single', 'conservative' or 'anticipative', not '" + name +
                                "'");
  return static_cast<SyncMode>(at - sync_names().begin());
}

double parse_pace(const std::string& text) {
  if (text == "realtime") return 1;
  if (text == "max") return 0;
  const char* what = "a pace is 'realtime', 'max' or a multiple of real time above 0";
  const double rate = number<double>(text, text, what);
  if (!(rate > 0) || rate > kLargestPace) throw std::invalid_argument(std::string(what) + ", not '" + text + "'");
  return rate;
}

std::pair<Step, Step> parse_steps(const std::string& text) {
  const char* what = "steps are A or A:B with 0 <= A <= B";
  const std::size_t colon = text.find(':');
  const std::string_view view = text;
  const Step first = number<Step>(view.substr(0, colon), text, what);
  const Step last = colon == std::string::npos ? first : number<Step>(view.substr(colon + 1), text, what);
  if (first < 0 || last < first) throw std::invalid_argument(std::string(what) + ", not '" + text + "'");
  return {first, last};
}

std::vector<WorldId> parse_worlds(const std::string& text) {
  constexpr WorldId kMost = 4096;
  const char* what = "worlds are 'none' or a list like 0,2-5";
  std::vector<WorldId> worlds;
  if (text == "none") return worlds;
  std::string_view rest = text;
  for (bool more = true; more;) {
    const std::size_t comma = rest.find(',');
    const std::string_view item = rest.substr(0, comma);
    more = comma != std::string_view::npos;
    if (more) rest.remove_prefix(comma + 1);
    const std::size_t dash = item.find('-');
    const WorldId first = number<WorldId>(item.substr(0, dash), text, what);
    const WorldId last = dash == std::string_view::npos ? first : number<WorldId>(item.substr(dash + 1), text, what);
    if (last < first || last >= kMost) throw std::invalid_argument(std::string(what) + ", not '" + text + "'");
    for (WorldId world = first; world <= last; ++world) worlds.push_back(world);
  }
  std::sort(worlds.begin(), worlds.end());
  worlds.erase(std::unique(worlds.begin(), worlds.end()), worlds.end());
  return worlds;
}

}  // namespace soda
