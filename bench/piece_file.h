// What a world of the model of a cluster was given, in a file: for another process.
#pragma once

#include <cstdio>
#include <vector>

#include "bench/cluster.h"

namespace soda::bench {

// Appends it. Throws std::runtime_error where the file cannot be written.
void keep(const std::vector<Cluster::Piece>& pieces, std::FILE* file);
// Reads the next. Throws std::runtime_error where it is cut short.
std::vector<Cluster::Piece> kept(std::FILE* file);

}  // namespace soda::bench
