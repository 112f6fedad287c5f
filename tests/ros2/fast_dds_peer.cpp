// Another vendor's DDS (eProsima Fast DDS) at the other end of a topic: payloads as they are on the
// wire, so that nothing of our types is in it. On the loopback only.
//
//     fast_dds_peer listen DOMAIN TOPIC TYPE COUNT   prints what it is offered, then COUNT payloads
//     fast_dds_peer send DOMAIN TOPIC TYPE           writes each line of its input, once somebody reads
//     fast_dds_peer call DOMAIN SERVICE TYPE         a client as rmw_fastrtps_cpp has it: prints how many read its
//                                                    requests and write replies, sends each line as a request
//
// Payloads are lines of hexadecimal digits, without the four bytes of the encapsulation.
#include <cstdio>
#include <cstring>
#include <iostream>
#include <memory>
#include <mutex>
#include <condition_variable>
#include <string>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/rtps/writer/WriterDiscoveryInfo.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::SerializedPayload_t;

namespace {

constexpr unsigned char kEncapsulation[] = {0, 1, 0, 0};  // CDR, low byte first

/// A payload of any type; its name alone says which.
class RawType : public TopicDataType {
public:
    explicit RawType(const std::string& name) {
        setName(name.c_str());
        m_typeSize = 1 << 20;
        m_isGetKeyDefined = false;
    }
    bool serialize(void* data, SerializedPayload_t* payload) override {
        const auto& bytes = *static_cast<std::string*>(data);
        payload->encapsulation = 1;
        payload->length = static_cast<uint32_t>(bytes.size() + sizeof kEncapsulation);
        std::memcpy(payload->data, kEncapsulation, sizeof kEncapsulation);
        std::memcpy(payload->data + sizeof kEncapsulation, bytes.data(), bytes.size());
        return true;
    }
    bool deserialize(SerializedPayload_t* payload, void* data) override {
        if (payload->length < 4 || std::memcmp(payload->data, kEncapsulation, 2) != 0) return false;
        static_cast<std::string*>(data)->assign(reinterpret_cast<char*>(payload->data) + 4,
                                                payload->length - 4);
        return true;
    }
    std::function<uint32_t()> getSerializedSizeProvider(void* data) override {
        return [data] { return static_cast<uint32_t>(static_cast<std::string*>(data)->size() + 4); };
    }
    void* createData() override { return new std::string; }
    void deleteData(void* data) override { delete static_cast<std::string*>(data); }
    bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
};

struct Matches : DataWriterListener {
    std::mutex mutex;
    std::condition_variable changed;
    int readers = 0;
    void on_publication_matched(DataWriter*, const PublicationMatchedStatus& status) override {
        std::lock_guard<std::mutex> lock(mutex);
        readers = status.current_count;
        changed.notify_all();
    }
};

/// Prints how many endpoints a client has found, at each change, as `wait_for_service` counts them.
struct Found : DataWriterListener, DataReaderListener {
    std::mutex mutex;
    int readers = 0, writers = 0;
    void print(int& counted, int count) {
        std::lock_guard<std::mutex> lock(mutex);
        counted = count;
        std::cout << "matched " << readers << ' ' << writers << std::endl;
    }
    void on_publication_matched(DataWriter*, const PublicationMatchedStatus& status) override {
        print(readers, status.current_count);
    }
    void on_subscription_matched(DataReader*, const SubscriptionMatchedStatus& status) override {
        print(writers, status.current_count);
    }
};

struct Offers : DomainParticipantListener {
    std::string topic;
    void on_publisher_discovery(DomainParticipant*,
                                eprosima::fastrtps::rtps::WriterDiscoveryInfo&& found) override {
        if (std::string(found.info.topicName()) != topic) return;
        const auto& data = found.info.m_qos.m_userData;
        std::lock_guard<std::mutex> lock(mutex);
        std::cout << "offer " << found.info.typeName() << ' '
                  << (found.info.m_qos.m_reliability.kind == RELIABLE_RELIABILITY_QOS ? "reliable"
                                                                                     : "best effort")
                  << ' ' << std::string(data.begin(), data.end()) << std::endl;
    }
    std::mutex mutex;
};

std::string hex(const std::string& bytes) {
    std::string text;
    char pair[3];
    for (unsigned char byte : bytes) {
        std::snprintf(pair, sizeof pair, "%02x", byte);
        text += pair;
    }
    return text;
}

std::string bytes_of(const std::string& text) {
    std::string bytes;
    for (size_t i = 0; i + 1 < text.size(); i += 2)
        bytes += static_cast<char>(std::stoi(text.substr(i, 2), nullptr, 16));
    return bytes;
}

DomainParticipant* on_loopback(int domain, DomainParticipantListener* listener) {
    auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    udp->interfaceWhiteList.push_back("127.0.0.1");
    DomainParticipantQos qos;
    qos.transport().use_builtin_transports = false;
    qos.transport().user_transports.push_back(udp);
    for (int index = 0; index < 10; ++index) {  // nobody has to hear a multicast
        eprosima::fastrtps::rtps::Locator_t peer;
        eprosima::fastrtps::rtps::IPLocator::setIPv4(peer, 127, 0, 0, 1);
        peer.port = static_cast<uint32_t>(7400 + 250 * domain + 10 + 2 * index);
        qos.wire_protocol().builtin.initialPeersList.push_back(peer);
    }
    return DomainParticipantFactory::get_instance()->create_participant(
        static_cast<uint32_t>(domain), qos, listener,
        StatusMask::none());
}

int listen(DomainParticipant* participant, Topic* topic, int count) {
    DataReaderQos qos;
    qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
    qos.history().depth = 100;
    auto* reader = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT)
                       ->create_datareader(topic, qos);
    std::string sample;
    SampleInfo info;
    while (count > 0) {
        reader->wait_for_unread_message(eprosima::fastrtps::Duration_t(60, 0));
        while (reader->take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK) {
            if (!info.valid_data) continue;
            std::cout << hex(sample) << std::endl;
            if (--count == 0) break;
        }
    }
    return 0;
}

int send(DomainParticipant* participant, Topic* topic) {
    static Matches matches;
    DataWriterQos qos;
    qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
    qos.history().depth = 100;
    qos.reliable_writer_qos().times.heartbeatPeriod = eprosima::fastrtps::Duration_t(0.05);
    auto* const writer = participant->create_publisher(PUBLISHER_QOS_DEFAULT)
                       ->create_datawriter(topic, qos, &matches);
    {
        std::unique_lock<std::mutex> lock(matches.mutex);
        matches.changed.wait(lock, [&] { return matches.readers > 0; });
    }
    std::cout << "matched" << std::endl;
    std::string line;
    while (std::getline(std::cin, line)) {
        std::string bytes = bytes_of(line);
        writer->write(&bytes);
    }
    return writer->wait_for_acknowledgments(eprosima::fastrtps::Duration_t(60, 0)) ==
                   ReturnCode_t::RETCODE_OK
               ? 0
               : 1;
}

int call(DomainParticipant* participant, const std::string& service, const std::string& type) {
    static Found found;
    DataReaderQos reads;
    reads.reliability().kind = RELIABLE_RELIABILITY_QOS;
    DataWriterQos writes;
    writes.reliability().kind = RELIABLE_RELIABILITY_QOS;
    writes.reliable_writer_qos().times.heartbeatPeriod = eprosima::fastrtps::Duration_t(0.05);
    const std::string kinds[] = {type + "_Request_", type + "_Response_"};
    const std::string names[] = {"rq" + service + "Request", "rr" + service + "Reply"};
    Topic* topics[2];
    for (int i = 0; i < 2; ++i) {
        TypeSupport(new RawType(kinds[i])).register_type(participant);
        topics[i] = participant->create_topic(names[i], kinds[i], TOPIC_QOS_DEFAULT);
    }
    auto* const reader = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT)
                             ->create_datareader(topics[1], reads, &found);
    auto* const writer = participant->create_publisher(PUBLISHER_QOS_DEFAULT)
                             ->create_datawriter(topics[0], writes, &found);
    std::string line;
    while (std::getline(std::cin, line)) {
        std::string bytes = bytes_of(line);
        eprosima::fastrtps::rtps::WriteParams params;
        params.related_sample_identity().writer_guid(reader->guid());
        writer->write(&bytes, params);
    }
    return 0;
}

}  // namespace

int main(int count, char** words) {
    if (count < 5) return 2;
    const bool listens = std::string(words[1]) == "listen";
    Offers offers;
    offers.topic = words[3];
    auto* participant = on_loopback(std::stoi(words[2]), listens ? &offers : nullptr);
    if (participant == nullptr) return 1;
    int code;
    if (std::string(words[1]) == "call") {
        code = call(participant, words[3], words[4]);
    } else {
        TypeSupport type(new RawType(words[4]));
        type.register_type(participant);
        auto* topic = participant->create_topic(words[3], words[4], TOPIC_QOS_DEFAULT);
        code = listens ? listen(participant, topic, count > 5 ? std::stoi(words[5]) : 1)
                       : send(participant, topic);
    }
    // The other end waits for a while for one that goes without a word.
    participant->delete_contained_entities();
    DomainParticipantFactory::get_instance()->delete_participant(participant);
    return code;
}
