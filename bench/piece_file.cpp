#include "bench/piece_file.h"

#include <cstdint>
#include <stdexcept>

namespace soda::bench {

void keep(const std::vector<Cluster::Piece>& pieces, std::FILE* file) {
  const auto put = [&](const void* from, std::size_t bytes) {
    if (std::fwrite(from, 1, bytes, file) != bytes) throw std::runtime_error("cannot keep what a world was given");
  };
  const auto number = [&](std::uint64_t n) { put(&n, sizeof n); };
  number(pieces.size());
  for (const Cluster::Piece& piece : pieces) {
    number(piece.order.has_value());
    const Cluster::Order order = piece.order.value_or(Cluster::Order{});
    put(&order, sizeof order);
    number(piece.patient);
    number(piece.messages.size());
    for (const auto& bytes : piece.messages) {
      number(bytes.size());
      put(bytes.data(), bytes.size());
    }
  }
}

std::vector<Cluster::Piece> kept(std::FILE* file) {
  const auto get = [&](void* to, std::size_t bytes) {
    if (std::fread(to, 1, bytes, file) != bytes) throw std::runtime_error("what a world was given is cut short");
  };
  const auto number = [&] {
    std::uint64_t n = 0;
    get(&n, sizeof n);
    return n;
  };
  std::vector<Cluster::Piece> pieces(number());
  for (Cluster::Piece& piece : pieces) {
    const bool ordered = number() != 0;
    Cluster::Order order{};
    get(&order, sizeof order);
    if (ordered) piece.order = order;
    piece.patient = number() != 0;
    piece.messages.resize(number());
    for (auto& bytes : piece.messages) {
      bytes.resize(number());
      get(bytes.data(), bytes.size());
    }
  }
  return pieces;
}

}  // namespace soda::bench
