#pragma once

#include <exception>
#include <string>

namespace mvstudio::testing {

/// Message of the exception of type E that `f` throws; says so when it throws another one or none.
template <class E, class F>
std::string MessageOf(F&& f) {
  try {
    f();
  } catch (const E& error) {
    return error.what();
  } catch (const std::exception& error) {
    return std::string("another exception: ") + error.what();
  }
  return "no exception";
}

}  // namespace mvstudio::testing
