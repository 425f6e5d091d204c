// What a border message costs over DDS: measured between two processes on this machine.
#pragma once

#include "bench/cluster.h"

namespace soda::bench {

// Latency and the processor's part, by sending messages of several sizes to and fro over UDP on the loopback interface,
// with the daemon's transport. `bytes_per_second` is not measured: loopback is no wire. Starts a process that ends
// before this returns; to be called before the program has other threads. Throws std::runtime_error where the two do
// not meet or lose each other.
Network measure_messages(bool quick);

}  // namespace soda::bench
