#pragma once

#include <sstream>
#include <string>

#include "core/fields.h"
#include "core/hash/sha256.h"

namespace mvstudio {

/// The key of a kept result: a digest of everything that determines it.
class KeptKey {
 public:
  void Add(const std::string& text) {
    digest_.Update(text.data(), text.size());
    digest_.Update("\n", 1);
  }
  /// Names and values of all fields of a struct of options.
  template <class Options>
  void AddFields(const Options& options) {
    VisitConstFields(
        [&](const std::string& name, const auto& value, const std::string&) {
          std::ostringstream text;
          text.precision(17);
          text << name << "=";
          if constexpr (kHasWords<std::decay_t<decltype(value)>>) {
            text << ToString(value);
          } else {
            text << value;
          }
          Add(text.str());
        },
        options);
  }
  std::string Take() { return digest_.HexDigest(); }

 private:
  Sha256 digest_;
};

}  // namespace mvstudio
