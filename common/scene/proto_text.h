// Protobuf's text format, in which scenes and actions are written by hand.
#pragma once

#include <google/protobuf/text_format.h>

#include <optional>
#include <string>
#include <string_view>

namespace soda {

// Of messages within messages, in what comes from outside: reading is recursive, and the stack is not endless.
constexpr int kMaxNesting = 64;

// What a text's reader complains of, and where: counted from 1.
struct TextProblem {
  int line = 0, column = 0;
  std::string reason;
};

// Reads `text`, of less than 2 GiB, into `message`. Returns the first complaint, if any; the others are mostly its
// consequences. `lines` gets where each field stands.
std::optional<TextProblem> read_text(std::string_view text, google::protobuf::Message& message,
                                     google::protobuf::TextFormat::ParseInfoTree* lines = nullptr);

}  // namespace soda
