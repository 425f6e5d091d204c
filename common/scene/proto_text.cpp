#include "common/scene/proto_text.h"

#include <google/protobuf/io/tokenizer.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

namespace soda {
namespace {

namespace gp = google::protobuf;

class FirstError : public gp::io::ErrorCollector {
 public:
  void AddError(int line, gp::io::ColumnNumber column, const std::string& text) override {
    if (!problem) problem = {line + 1, static_cast<int>(column) + 1, text};
  }
  void AddWarning(int, gp::io::ColumnNumber, const std::string&) override {}
  std::optional<TextProblem> problem;
};

}  // namespace

std::optional<TextProblem> read_text(std::string_view text, gp::Message& message,
                                     gp::TextFormat::ParseInfoTree* lines) {
  gp::TextFormat::Parser parser;
  FirstError error;
  parser.RecordErrorsTo(&error);
  parser.SetRecursionLimit(kMaxNesting);
  if (lines != nullptr) parser.WriteLocationsTo(lines);
  gp::io::ArrayInputStream stream(text.data(), static_cast<int>(text.size()));
  if (parser.Parse(&stream, &message)) return std::nullopt;
  return error.problem.value_or(TextProblem{0, 0, "is not in Protobuf text format"});
}

}  // namespace soda
