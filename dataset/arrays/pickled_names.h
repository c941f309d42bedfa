// Private: for the readers of tables.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace mvstudio::dataset::internal {

/// A Python pickle (protocols 0 to 5) of a list of tuples of texts, as PyTables stores names of columns. Nothing is
/// executed: of the pickle machine (CPython, Lib/pickletools.py) only lists, tuples, texts, whole numbers and None are known.
/// Numbers and None become texts ("" for None). Empty for anything else.
std::optional<std::vector<std::vector<std::string>>> ReadPickledNames(std::string_view pickle);

}  // namespace mvstudio::dataset::internal
