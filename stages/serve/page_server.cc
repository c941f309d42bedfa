#include "stages/serve/page_server.h"

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <chrono>
#include <list>
#include <memory>
#include <optional>
#include <random>

#include "core/error.h"
#include "core/format.h"

namespace mvstudio::stages {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using Request = http::request<http::string_body>;
using Response = http::response<http::string_body>;

constexpr size_t kMostBytes = size_t{1} << 20;  // of a request
constexpr std::chrono::seconds kPatience(20);   // with a connection that says nothing
constexpr size_t kMostConnections = 256;
constexpr size_t kSpare = 8;                        // connections closed where there are too many, or no descriptors left
constexpr std::chrono::milliseconds kRecovery(50);  // before the next one is accepted then

constexpr char kPolicy[] =
    "default-src 'none'; img-src 'self'; script-src 'self'; style-src 'self'; connect-src 'self'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'";

std::string RandomToken() {
  std::random_device random;
  std::string token;
  for (int i = 0; i < 4; ++i) token += Format("%08x", static_cast<unsigned>(random()));
  return token;
}

PageAnswer Refused(int status, const std::string& text) { return {status, "text/plain; charset=utf-8", text + "\n"}; }

/// Where the server is, and what it says.
struct Site {
  std::string token, host;  ///< "127.0.0.1:8123"
  PageServer::Answer answer;

  PageAnswer Find(const Request& request) const {
    const auto header = [&](http::field field) {
      const auto value = request[field];
      return std::string(value.data(), value.size());
    };
    const std::string target(request.target().data(), request.target().size()), base = "/" + token + "/";
    const std::string origin = header(http::field::origin);
    if (request.count(http::field::host) != 1) return Refused(400, "one host was expected");
    if (header(http::field::host) != host || target.rfind(base, 0) != 0) return Refused(404, "not here");
    if (request.count(http::field::origin) > 1 || (!origin.empty() && origin != "http://" + host))
      return Refused(403, "not for other sites");
    const bool gets = request.method() == http::verb::get || request.method() == http::verb::head;
    if (!gets && request.method() != http::verb::post) return Refused(405, "GET or POST");
    const std::string method = gets ? "GET" : "POST";
    try {
      return answer({method, target.substr(base.size()), request.body()});
    } catch (const FormatError& error) {
      return Refused(400, error.what());
    } catch (const UsageError& error) {
      return Refused(400, error.what());
    } catch (const std::exception& error) {
      return Refused(500, error.what());
    }
  }

  Response Respond(const Request& request) const {
    const PageAnswer found = Find(request);
    Response response(static_cast<http::status>(found.status), request.version());
    response.set(http::field::content_type, found.type);
    response.set("Content-Security-Policy", found.policy.empty() ? kPolicy : found.policy);
    response.set("X-Content-Type-Options", "nosniff");
    response.set("Referrer-Policy", "no-referrer");
    response.set("Cross-Origin-Resource-Policy", "same-origin");
    response.set(http::field::cache_control, "no-store");
    response.body() = found.body;
    response.keep_alive(request.keep_alive());
    response.prepare_payload();
    if (request.method() == http::verb::head) response.body().clear();  // its length stays in the header
    return response;
  }
};

/// One connection of the browser.
class Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(tcp::socket socket, const Site& site) : stream_(std::move(socket)), site_(site) {}

  void Read() {
    parser_.emplace();
    parser_->body_limit(kMostBytes);
    stream_.expires_after(kPatience);
    http::async_read(stream_, buffer_, *parser_,
                     [self = shared_from_this()](beast::error_code error, size_t) { self->Answer(error); });
  }
  void Close() { stream_.close(); }

 private:
  void Answer(beast::error_code error) {
    if (error == http::error::body_limit) return Send(Bare(http::status::payload_too_large));
    if (error == http::error::header_limit) return Send(Bare(http::status::request_header_fields_too_large));
    const bool no_http = error.category() == beast::error_code(http::error::bad_method).category();
    if (no_http && error != http::error::end_of_stream && error != http::error::partial_message)
      return Send(Bare(http::status::bad_request));
    if (error) return;  // closed or late
    Send(site_.Respond(parser_->get()));
  }
  static Response Bare(http::status status) {
    Response response(status, 11);
    response.keep_alive(false);
    response.prepare_payload();
    return response;
  }
  void Send(Response response) {
    response_ = std::move(response);
    stream_.expires_after(kPatience);  // whatever the answer took
    http::async_write(stream_, response_, [self = shared_from_this()](beast::error_code failed, size_t) {
      if (!failed && self->response_.keep_alive()) return self->Read();
      beast::error_code ignored;
      self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
    });
  }

  beast::tcp_stream stream_;
  beast::flat_buffer buffer_{kMostBytes + 65536};
  std::optional<http::request_parser<http::string_body>> parser_;
  Response response_;
  const Site& site_;
};

}  // namespace

struct PageServer::Impl {
  asio::io_context io;
  tcp::acceptor acceptor{io};
  asio::steady_timer recovery{io};
  std::list<std::weak_ptr<Connection>> connections;  ///< the oldest first
  size_t most = kMostConnections;
  Site site;
  std::string url;

  void Accept() {
    acceptor.async_accept([this](beast::error_code error, tcp::socket socket) {
      if (error == asio::error::operation_aborted) return;
      if (error) return Recover();
      const auto connection = std::make_shared<Connection>(std::move(socket), site);
      connections.remove_if([](const auto& other) { return other.expired(); });
      connections.push_back(connection);
      connection->Read();
      if (connections.size() > most) CloseOldest();
      Accept();
    });
  }
  /// Whoever holds connections open without end, and without the token, shuts nobody out.
  void CloseOldest() {
    for (size_t i = 0; i < kSpare && !connections.empty(); ++i) {
      if (const auto oldest = connections.front().lock()) oldest->Close();
      connections.pop_front();
    }
  }
  /// No descriptor is left for another connection.
  void Recover() {
    connections.remove_if([](const auto& other) { return other.expired(); });
    CloseOldest();
    most = std::max(kSpare, connections.size());  // the page's table needs descriptors, too
    recovery.expires_after(kRecovery);
    recovery.async_wait([this](beast::error_code error) {
      if (!error) Accept();
    });
  }
};

PageServer::PageServer(int port, Answer answer) : impl_(std::make_unique<Impl>()) {
  const tcp::endpoint place(asio::ip::address_v4::loopback(), static_cast<uint16_t>(port));
  beast::error_code error;
  impl_->acceptor.open(place.protocol(), error);
  if (!error) impl_->acceptor.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error) impl_->acceptor.bind(place, error);
  if (!error) impl_->acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (error) throw ResourceError("127.0.0.1, port " + std::to_string(port) + ": cannot listen: " + error.message());
  impl_->site.token = RandomToken();
  impl_->site.host = "127.0.0.1:" + std::to_string(impl_->acceptor.local_endpoint().port());
  impl_->site.answer = std::move(answer);
  impl_->url = "http://" + impl_->site.host + "/" + impl_->site.token + "/";
  impl_->Accept();
}

PageServer::~PageServer() = default;

const std::string& PageServer::url() const { return impl_->url; }

void PageServer::Run(const std::function<bool()>& stop) {
  while (!stop()) {
    impl_->io.restart();
    impl_->io.run_for(std::chrono::milliseconds(100));
  }
  beast::error_code ignored;
  impl_->acceptor.close(ignored);
}

}  // namespace mvstudio::stages
