"""Links to the robot's other programs: desired state out, reported state in.

The gateway owns the desired state and applies it until the service has it; the service owns the actual state
and reports it in a stream. No request of an operator waits for a service longer than its own limit.

Failures, what the view says then (for the preview), and what the link does:

service absent at start, or gone
    FAULTED "preview service unreachable" when it shall run, DISABLED when not.
    Reconnects with exponential backoff, 0.1 to 1 s, and at once on a new request.
service comes (back) with an empty memory
    What the service reports. Applies the desired state again; a pipeline that starts counts as a restart.
service frozen: no report for 2.5 s, or a request not answered for 2 s
    As gone. Drops the connection; each further attempt ends after 2.5 s.
service refuses the desired state
    FAULTED with the service's message. Waits for the next request or the next process of the service.
service reports a state that this gateway does not know
    As gone, naming the cause.
service has a newer revision than ours: a second gateway applies to it
    What the service reports. Numbers its own desired state above and applies it, with backoff.
gateway restarted, no request since
    What the service reports, whose desired state is adopted: video continues. An encrypted stream restarts
    with a new passphrase, because the old one is unknown.
several operators request at the same time
    The newest request counts; the answers to the others say that they were replaced.

watch.py connects to a service, takes its reports and notices silence. On it stands link.py, which applies the
desired state as reconciler.py decides (pure). grpc_client.py has what services on gRPC share.

A folder for each service: wire.py has its schema and client. Where the gateway owns the desired state,
state.py and model.py have that state, its rules and its view: the preview, with control.py for operators'
requests and feedback.py for viewers', and the drive program, with commands.py for what can't wait for the
link. The recorder and the bridge own theirs: link.py has the view, calls.py passes requests on, refusals.py
has their errors.
"""
