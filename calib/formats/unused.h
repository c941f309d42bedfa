// Private: for the readers of calib/.
#pragma once

#include <initializer_list>
#include <string>

#include "calib/formats/document.h"
#include "calib/formats/formats.h"
#include "geometry/rig/file_keys.h"

/// Keys that a reader did not ask for: a ValueView remembers those it was asked for.
namespace mvstudio::calib::internal {

/// A number, a text, or JSON-like text of a list or table; empty for null.
std::string TextOf(const Value& value);

/// What the table's keys say about its lens; marks them as read.
void AddLensWords(const ValueView& table, geometry::LensWords* words);
/// The kind that file and option state. Throws FormatError when they differ.
geometry::LensKind LensKindOf(const geometry::LensWords& words, const ReadOptions& options, const Place& place);

/// Adds the keys that nobody read in the table and in the tables and lists that were read; `harmless` names, in lower case
/// letters and digits, those that say nothing about geometry.
void AddUnused(const ValueView& table, std::initializer_list<const char*> harmless, geometry::UnusedKeys* unused);

/// The note on them, if there are any.
void AddUnusedNote(const geometry::UnusedKeys& unused, ImportedRig* imported);

}  // namespace mvstudio::calib::internal
