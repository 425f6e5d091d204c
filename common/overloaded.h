// For std::visit: one function for each alternative of a variant.
#pragma once

namespace soda {

template <class... F>
struct Overloaded : F... {
  using F::operator()...;
};

}  // namespace soda
