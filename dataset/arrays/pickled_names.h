// Private: for the readers of tables.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace mvstudio::dataset::internal {

/// A Python pickle (protocols 0 to 5) of a list of tuples of texts, as PyTables stores names of columns. Nothing is
/// executed. Whole numbers and None become texts ("" for None). Empty for anything else.
std::optional<std::vector<std::vector<std::string>>> ReadPickledNames(const std::string& pickle);

}  // namespace mvstudio::dataset::internal
