// What an import could not take over, each kind once with a count and its first place.
#pragma once

#include <map>
#include <string>
#include <vector>

namespace soda {

class Warnings {
 public:
  // `kind` says what and what is done about it; `place` names one element.
  void add(const std::string& kind, const std::string& place, std::size_t times = 1) {
    if (times == 0) return;
    const auto [entry, is_new] = index_.emplace(kind, kinds_.size());
    if (is_new) kinds_.push_back({kind, place, 0});
    kinds_[entry->second].count += times;
  }

  // In the order of first appearance: "<sensor> is not modelled (3 times, first in m::l)".
  std::vector<std::string> list() const {
    std::vector<std::string> lines;
    for (const Kind& k : kinds_) {
      std::string detail = k.count > 1 ? std::to_string(k.count) + " times" : "";
      if (!k.place.empty()) detail += (k.count > 1 ? ", first in " : "in ") + k.place;
      lines.push_back(k.kind + (detail.empty() ? "" : " (" + detail + ")"));
    }
    return lines;
  }

 private:
  struct Kind {
    std::string kind, place;
    std::size_t count;
  };
  std::vector<Kind> kinds_;
  std::map<std::string, std::size_t> index_;
};

}  // namespace soda
