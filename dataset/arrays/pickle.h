#pragma once

#include <map>
#include <string>

#include "core/disk/npy.h"

namespace mvstudio::dataset {

/// The arrays of a pickled dict: numpy arrays, scipy's csc matrices (made dense) and the `x` of chumpy arrays, by their keys.
/// Entries of other kinds are left out. Protocols 0 to 5.
///
/// Nothing of the file is run. A pickle is a program for a stack machine; this machine knows numbers, texts, tuples, lists,
/// dicts and the few classes above. Throws FormatError with the byte: any other class or function is refused by its name.
std::map<std::string, NpyArray> ArraysFromPickle(const std::string& bytes, const std::string& path);

}  // namespace mvstudio::dataset
