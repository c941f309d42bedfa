#pragma once

/// The one list of the fields of an options struct. Beside each struct `Options` stands
///
///     template <class Visitor>
///     void VisitFields(Visitor&& visit, Options& o) {
///       visit("max-error-px", o.max_error_px, "px; views with a larger residual are dropped");
///     }
///
/// and command-line flags, provenance and the tables of docs/cli.md all come from it. Field types: bool, int, int64_t,
/// uint64_t, double, std::string, std::vector<std::string>.
/// A library knows no flags: its texts name an option as `option 'max-error-px'`, of which the program makes its flag.
namespace mvstudio {

/// Calls `visit(name, value, help)` for each field of a const options struct.
template <class Visitor, class Options>
void VisitConstFields(Visitor&& visit, const Options& options) {
  Options copy = options;
  VisitFields(visit, copy);
}

}  // namespace mvstudio
